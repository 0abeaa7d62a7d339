"""Off-screen windows that somebody watches in a browser: a remote view of trame, a viewer of VDIs.

A viewer that draws VDIs by itself says so (:func:`follow`). ``trame_vtk`` keeps for each of its
servers a helper, and in it a publisher of pictures, which knows the windows that browsers have
asked for. Nothing here imports it: where it has not been imported, nobody watches by it. Where a
version of it keeps other names, nobody seems to.
"""

from __future__ import annotations

import sys
import threading
import weakref
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from typing import Any, Protocol

#: What has the helpers, where somebody has imported it.
_TRAME = "trame_vtk.modules.vtk"


class Follower(Protocol):
    """What shows, in a browser, the VDIs of a window as they are after each of its frames."""

    window: Any

    def draw(self) -> object:
        """Draw the window: something in it is new."""


_followers: weakref.WeakSet[Follower] = weakref.WeakSet()
_lock = threading.Lock()  # windows are drawn in other threads, and a set that grows is not walked


def follow(follower: Follower) -> None:
    """Keep, weakly, what follows a window."""
    with _lock:
        _followers.add(follower)


def watches(window: Any) -> bool:
    """Whether a browser shows pictures of a window, or follows it."""
    if not _followers and _TRAME not in sys.modules:
        return False
    return bool(_following(window)) or next(_publishers(window), None) is not None


def push(window: Any) -> bool:
    """Draw a window and send its picture to the browsers that show it; return whether any does."""
    publishers, followers = list(_publishers(window)), _following(window)
    for publisher, number in publishers:
        publisher.image_push({"view": number})
    for follower in followers[:1]:  # a frame is seen by all
        follower.draw()
    return bool(publishers or followers)


class SceneAtHand:
    """Knows a scene that browsers have been given, but do not draw as long as the server does.

    Parameters
    ----------
    begun : bound method
        Called when a browser begins to draw the scene; held weakly.
    """

    def __init__(self, begun: Callable[[], object]) -> None:
        self._begun = weakref.WeakMethod(begun)  # type: ignore[arg-type]
        self._views: weakref.WeakSet[Any] = weakref.WeakSet()
        self._changes = 0  # that were written, of scenes that were not written whole since

    def is_all(self, window: Any) -> bool:
        """Whether a window's scene, which is being written, is only for such browsers.

        What trame has at hand it writes twice, what has changed and then all of it, as its
        contexts say; a scene that is exported is written whole at once.
        """
        self._changes += -1 if any(_writes_all(helper) for helper in _helpers()) else 1
        exported, self._changes = self._changes < 0, max(self._changes, 0)
        views = [view for view in _hybrid_views() if view._view is window]
        if not views or exported or not all(_drawn_by_server(view) for view in views):
            return False
        for view in views:
            if view not in self._views:
                self._views.add(view)
                told = partial(_mode_changed, self._begun, weakref.ref(view))
                view._app.state.change(*_mode_keys(view))(told)
        return True


def _mode_changed(begun: Any, view: Any, /, **_: Any) -> None:
    """Be told by trame that a view is drawn by the server, or in the browser."""
    say, of = begun(), view()
    if say is not None and of is not None and not _drawn_by_server(of):
        say()


def _following(window: Any) -> list[Follower]:
    with _lock:
        followers = list(_followers)
    return [follower for follower in followers if follower.window is window]


def _helpers() -> list[Any]:
    module = sys.modules.get(_TRAME)
    return list(getattr(module, "HELPERS_PER_SERVER", {}).values())


def _writes_all(helper: Any) -> bool:
    """Whether trame is writing a scene whole, and not what has changed in it."""
    protocol = getattr(helper, "_root_protocol", None)
    found = [] if protocol is None else protocol.getLinkProtocols()
    contexts = [getattr(each, "context", None) for each in found]
    return any(getattr(context, "ignore_last_dependencies", False) for context in contexts)


def _publishers(window: Any) -> Iterator[tuple[Any, str]]:
    """Yield those who send pictures of a window to browsers, and the number they know it by."""
    for helper in _helpers():
        with suppress(AttributeError):
            for protocol in helper._root_protocol.getLinkProtocols():
                for number in list(getattr(protocol, "tracking_views", ())):
                    if hasattr(protocol, "image_push") and helper.object(number) is window:
                        yield protocol, number


def _hybrid_views() -> list[Any]:
    """Return trame's views that are drawn by the server or in the browser, as a person chooses."""
    return [view for helper in _helpers() for view in getattr(helper, "_hybrid_views", {}).values()]


def _mode_keys(view: Any) -> tuple[str, str]:
    """Return the names of what says where a view is drawn: PyVista's, which counts, and trame's."""
    return f"{view.ref_key}_use_server_rendering", view.mode_key


def _drawn_by_server(view: Any) -> bool:
    state = view._app.state.to_dict()
    by_server, mode = (state.get(key) for key in _mode_keys(view))
    return mode == "remote" if by_server is None else bool(by_server)
