"""A window of Qt with a VDI in it, and a slider that changes what is seen: pyvistaqt.

What one should see: a brain that turns under the mouse; the slider makes it denser at once, as no
VDI is made for that.

    pip install "pyvista-vdi[cpu,plot,qt]"
    python examples/qt_window.py                # a window; needs a screen
"""

from __future__ import annotations

import sys

from pyvistaqt import QtInteractor
from qtpy.QtCore import Qt
from qtpy.QtWidgets import QApplication, QMainWindow, QSlider, QVBoxLayout, QWidget

import pyvista_vdi as pvdi


def main() -> int:
    """Open the window, and stay until it is closed."""
    app = QApplication(sys.argv)
    window, inside = QMainWindow(), QWidget()
    layout = QVBoxLayout(inside)
    plotter = QtInteractor(inside)
    density = QSlider(Qt.Orientation.Horizontal)
    density.setRange(1, 40)
    density.setValue(10)
    layout.addWidget(plotter)
    layout.addWidget(density)
    window.setCentralWidget(inside)
    window.resize(800, 600)

    brain = pvdi.examples.load_brain()
    actor = plotter.add_vdi(brain, cmap="mri-brain", shade=True, show_scalar_bar=False)

    def change(value: int) -> None:
        actor.opacity_multiplier = value / 10
        plotter.render()

    density.valueChanged.connect(change)
    window.show()
    status = app.exec()
    plotter.close()
    return status


if __name__ == "__main__":
    sys.exit(main())
