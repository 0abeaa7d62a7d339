"""ParaView's client side of an algorithm, and its output window."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from vtkmodules.vtkCommonCore import vtkOutputWindow

from pyvista_vdi.vtk_pipeline.filters.algorithm import watch


class Client:
    """ParaView's client side of an algorithm, where it lives in the same process."""

    def __init__(self, manager: Any, proxy: Any) -> None:
        self.manager = manager
        self.proxy = proxy

    @staticmethod
    def _manager() -> Any:
        from paraview.modules.vtkRemotingServerManager import vtkSMProxyManager

        if not vtkSMProxyManager.IsInitialized():
            return None
        return vtkSMProxyManager.GetProxyManager().GetActiveSessionProxyManager()

    @classmethod
    def of(cls, algorithm: Any, *, silent: bool = False) -> Client | None:
        """Return the client side, or ``None`` after having said why there is none."""
        manager = cls._manager()
        for i in range(manager.GetNumberOfProxies("sources") if manager else 0):
            proxy = manager.GetProxy("sources", manager.GetProxyName("sources", i))
            if proxy.GetClientSideObject() is algorithm:
                return cls(manager, proxy)
        if not silent:
            problem = "client and server are two processes: set the properties from the client"
            say(algorithm, problem)
        return None

    @classmethod
    def watch(cls, algorithm: Any, event: str, changed: Callable[[Any], None]) -> bool:
        """Call ``changed(algorithm)`` at an event of the manager; return whether there is one."""
        manager = cls._manager()
        return manager is not None and bool(watch(manager, algorithm, changed, event))

    def views(self) -> list[Any]:
        """Return the proxies of render views."""
        number = self.manager.GetNumberOfProxies("views")
        names = [self.manager.GetProxyName("views", i) for i in range(number)]
        views = [self.manager.GetProxy("views", name) for name in names]
        return [view for view in views if hasattr(view.GetClientSideObject(), "GetRenderer")]

    def representations(self) -> list[tuple[str, Any]]:
        """Return the names and proxies of what shows the algorithm's output in views."""
        found = []
        for i in range(self.manager.GetNumberOfProxies("representations")):
            name = self.manager.GetProxyName("representations", i)
            proxy = self.manager.GetProxy("representations", name)
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


def say(algorithm: Any, problem: object) -> None:
    """Write what went wrong to ParaView's output window."""
    text = f"{type(algorithm).__name__}: {problem}\n"
    vtkOutputWindow.GetInstance().DisplayErrorText(text)
