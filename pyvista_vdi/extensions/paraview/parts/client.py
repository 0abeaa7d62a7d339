"""ParaView's client side of an algorithm, its output window, and its server's processes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from vtkmodules.vtkCommonCore import vtkOutputWindow


class Client:
    """ParaView's client side of an algorithm, where it lives in the same process."""

    def __init__(self, manager: Any, proxy: Any) -> None:
        self.manager = manager
        self.proxy = proxy

    @classmethod
    def of(cls, algorithm: Any, *, silent: bool = False) -> Client | None:
        """Return the client side, or ``None`` after having said why there is none."""
        manager = manager_of_proxies()
        for _, proxy in _proxies(manager, "sources") if manager else ():
            if proxy.GetClientSideObject() is algorithm:
                return cls(manager, proxy)
        if not silent:
            say(algorithm, "client and server are two processes: set properties from the client")
        return None

    def representations(self) -> list[tuple[str, Any]]:
        """Return the names and proxies of what shows the algorithm's output in views."""
        found = []
        for name, proxy in _proxies(self.manager, "representations"):
            source = proxy.GetProperty("Input")
            inputs = source.GetNumberOfProxies() if source is not None else 0
            if inputs and source.GetProxy(0) is self.proxy:
                found.append((name, proxy))
        return found

    def values(self, name: str, proxy: Any = None) -> list[Any]:
        """Return a property's values, of this algorithm or of another proxy."""
        prop = (proxy or self.proxy).GetProperty(name)
        return [prop.GetElement(i) for i in range(prop.GetNumberOfElements())]

    def set(self, name: str, values: list[Any]) -> None:
        """Set a property's values; ``UpdateVTKObjects`` applies them."""
        prop = self.proxy.GetProperty(name)
        for i, value in enumerate(values):
            prop.SetElement(i, value)


def _proxies(manager: Any, group: str) -> Iterator[tuple[str, Any]]:
    """Yield the names and proxies of a group."""
    for i in range(manager.GetNumberOfProxies(group)):
        name = manager.GetProxyName(group, i)
        yield name, manager.GetProxy(group, name)


def manager_of_proxies() -> Any:
    """Return ParaView's manager of proxies; false where there is none in this process."""
    from paraview.modules.vtkRemotingServerManager import vtkSMProxyManager

    started = vtkSMProxyManager.IsInitialized()
    return started and vtkSMProxyManager.GetProxyManager().GetActiveSessionProxyManager()


def say(algorithm: Any, problem: object) -> None:
    """Write what went wrong to ParaView's output window."""
    text = f"{type(algorithm).__name__}: {problem}\n"
    vtkOutputWindow.GetInstance().DisplayErrorText(text)


def require_one_process(controller: Any) -> None:
    """Raise ImportError if ParaView's server has several ranks, by its controller."""
    count = 1 if controller is None else controller.GetNumberOfProcesses()
    if count > 1:
        raise ImportError(
            f"this server has {count} ranks, and the VDI plugin works with one: start pvserver or "
            "pvbatch without mpirun, or let the ranks of a simulation make the VDI, by "
            "pyvista_vdi.extensions.insitu.InSitu, and open its file"
        )
