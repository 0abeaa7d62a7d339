"""What an actor does with a series of VDIs: show a step, and play."""

from __future__ import annotations

from typing import Any

from pyvista_vdi.errors import InvalidArgumentError
from pyvista_vdi.model.collection import RATE, VDICollection


class PlayingMethods:
    """Mixed into what shows a VDI; see :attr:`Input.player`."""

    @property
    def series(self: Any) -> VDICollection | None:
        """The series that is shown; ``None`` where a single VDI or a volume is.

        Another one that is set is shown from the next frame on, at the step nearest in time.
        """
        mapper = self.GetMapper()
        return None if mapper is None else mapper.GetSeries()

    @series.setter
    def series(self: Any, series: VDICollection) -> None:
        mapper = self._mapper_for(" that could show a series")
        before = None if mapper.GetSeries() is None else self.time
        mapper.SetSeries(series)
        if before is not None:
            self.time = before

    @property
    def time(self: Any) -> float:
        """Time of the step that is shown; one that is set shows the step nearest to it.

        The step is there in the next frame, whatever it takes to decode. InvalidArgumentError is
        raised where no series is shown.
        """
        return self._player().time  # type: ignore[no-any-return]

    @time.setter
    def time(self: Any, time: float) -> None:
        self._player().time = time
        self.GetMapper().Modified()

    @property
    def step(self: Any) -> int:
        """Index of the step that is shown, 0 and up; negative ones that are set are from the end.

        As :attr:`time`.
        """
        return self._player().step  # type: ignore[no-any-return]

    @step.setter
    def step(self: Any, step: int) -> None:
        self._player().step = step
        self.GetMapper().Modified()

    @property
    def playing(self: Any) -> bool:
        """Whether one step is shown after the other."""
        mapper = self.GetMapper()
        shown = None if mapper is None else mapper.driver.input
        return shown is not None and shown.player is not None and shown.player.playing

    def play(
        self: Any,
        rate: float = RATE,
        *,
        loop: bool = True,
        memory_limit: float | str | None = None,
    ) -> None:
        """Show one step after the other, from the one that is shown, while the view can be turned.

        Steps are decoded behind the frames, ahead of their time. Those that are not ready when
        their time comes are left out: time does not wait. In a window without an event loop, as
        off-screen, the step of the moment is shown whenever the window is drawn; for a movie set
        :attr:`time` before each frame.

        Parameters
        ----------
        rate : float
            Steps per second.
        loop : bool
            Whether the first step follows the last; otherwise that is the end.
        memory_limit : float or str, optional
            Bytes that decoded steps may take, or as ``"2 GiB"``; 1 GiB by default. Those that are
            kept need not be decoded in the next round.

        Raises
        ------
        InvalidArgumentError
            If no series is shown, the rate is none, or the limit no number of bytes.
        """
        self._player().play(rate, loop=loop, memory_limit=memory_limit)
        driver = self.GetMapper().driver
        renderer = driver.renderer()
        window = None if renderer is None else renderer.GetRenderWindow()
        # Before the first frame there is nothing to look at, and that frame looks itself
        if window is not None and not window.GetNeverRendered():
            driver.follow(window)

    def pause(self: Any) -> None:
        """Stay at the step that is shown.

        Raises
        ------
        InvalidArgumentError
            If no series is shown.
        """
        self._player().pause()

    def _player(self: Any) -> Any:
        shown = self._mapper_for(" that could show a series").driver.input
        if shown is None or shown.player is None:
            raise InvalidArgumentError(
                "this actor shows no series, which alone has times: add one (plotter.add_vdi("
                "pyvista_vdi.read('x.vdis'))), or set it (actor.series = series)"
            )
        return shown.player
