"""Functions whose arguments are options: their signature, their docstring, and what they refuse."""

from __future__ import annotations

import difflib
import inspect
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field, make_dataclass, replace
from functools import wraps
from inspect import Parameter
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError, InvalidArgumentTypeError
from pyvista_vdi.model.options import (
    RECORDS,
    Deferral,
    DrawingOptions,
    GenerationOptions,
    Option,
    Options,
    QualityTarget,
    RenderOptions,
    declared,
    entries,
    record,
)


def refuse_unknown(given: Iterable[str], function: str, known: Iterable[str]) -> None:
    """Raise TypeError for the first argument whose name is not known, and say what is meant."""
    known = [name for name in known if name not in ("self", "look")]
    options = declared(*RECORDS)
    for name in given:
        if name in known:
            continue
        elsewhere = (each.elsewhere for each in RECORDS if name in vars(each)["declared"])
        near = difflib.get_close_matches(name, known, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(known)}"
        hint = next(filter(None, elsewhere), hint)
        if "settings" in known and name in options and options[name].setting:
            hint = f"pass it by settings=pyvista_vdi.Settings({name}=...)"
        raise TypeError(f"{function}() got an unexpected keyword argument {name!r}: {hint}")


#: The options that are settings, of whichever record, as the fields of one.
_FIELDS = [
    (name, told.kind, field(default=told.default, metadata={"option": told}))
    for name, told in declared(
        GenerationOptions, QualityTarget, Deferral, RenderOptions, DrawingOptions
    ).items()
    if told.setting
]
_Fields: Any = record(
    make_dataclass("_Fields", _FIELDS, bases=(Options,), frozen=True, kw_only=True)
)


class Settings(_Fields):  # type: ignore[misc]  # noqa: D101 - made of the options' texts
    __doc__ = f"""Options that are seldom turned, for ``settings=`` of whatever has a use for them.

    Parameters
    ----------
{entries(_Fields.declared.values())}
    Raises
    ------
    TypeError
        If a keyword is unknown.
    InvalidArgumentError
        If a value is out of range.

    Examples
    --------
    >>> import pyvista_vdi as pvdi
    >>> pvdi.Settings(tolerance=0.01, memory_limit=2**31).given
    {{'memory_limit': 2147483648, 'tolerance': 0.01}}
    """
    __signature__ = inspect.signature(_Fields)

    def __init__(self, **given: Any) -> None:
        refuse_unknown(given, "Settings", self.declared)
        super().__init__(**given)
        # What was given, defaults among it
        object.__setattr__(self, "said", {name: getattr(self, name) for name in given})


class Raw:
    """In place of a record: its options as they are given, to be checked by the function."""

    def __init__(self, record: type[Options]) -> None:
        self.declared = record.declared

    def checked(self, **given: Any) -> dict[str, Any]:
        """Return all of the options by their names."""
        return {name: given.get(name, told.default) for name, told in self.declared.items()}


def takes(
    *,
    order: Iterable[str] = (),
    aliases: Mapping[str, str] | None = None,
    returns: Mapping[str, Any] | None = None,
    kinds: Mapping[str, str] | None = None,
    **records: Any,
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Make the options of records the arguments of a function, which gets the records.

    The function has a parameter for each record, by the names of ``records``. Its signature then
    has the options instead, by keyword, or where ``order`` has their names as positional arguments
    of that order; and its docstring an entry for each that it does not describe itself.
    ``aliases`` are other names that are taken as well. ``returns``: what the function returns, by
    the values of an option; ``kinds``: types of options that are others than declared. What is
    seldom turned is taken as ``settings``.
    """
    options: dict[str, Option] = {}
    for each in records.values():
        options |= each.declared
    for name, kind in (kinds or {}).items():
        options[name] = replace(options[name], kind=kind)
    hidden = {name for name, told in options.items() if told.setting}
    shown = {name: told for name, told in options.items() if name not in hidden}
    if hidden:
        what = f"options that are seldom turned; here {', '.join(sorted(hidden))}"
        shown["settings"] = Option("settings", None, what, kind="Settings | None")
    other = aliases or {}

    def decorated(function: Callable[..., Any]) -> Callable[..., Any]:
        signature = _signature(function, records, shown, [*order])
        named = signature.parameters
        open_ended = any(each.kind is Parameter.VAR_KEYWORD for each in named.values())
        called_by = "add_vdi" if function.__name__ == "__call__" else function.__name__

        @wraps(function)
        def called(*args: Any, **given: Any) -> Any:
            for alias in other.keys() & given.keys():
                given[other[alias]] = given.pop(alias)
            if not open_ended and not given.keys() <= named.keys():
                refuse_unknown(given, called_by, (*named, *other))
            try:
                signature.bind(*args, **given)
            except TypeError as error:
                raise TypeError(f"{called_by}() {error}") from None
            given |= zip(named, args, strict=False)
            made = records_of(given, called_by, *records.values())
            return function(**given, **dict(zip(records, made, strict=True)))

        text = _documented(function.__doc__ or "", shown.values())
        vars(called).update(__signature__=signature, returns=returns)
        called.__doc__ = text
        return called

    return decorated


def _signature(
    function: Callable[..., Any],
    records: Mapping[str, Any],
    options: Mapping[str, Option],
    order: list[str],
) -> inspect.Signature:
    """Return the signature of a function with options in place of its records."""
    own = inspect.signature(function)
    kept = {each.name: each for each in own.parameters.values() if each.name not in records}
    for name, told in options.items():
        kind = Parameter.POSITIONAL_OR_KEYWORD if name in order else Parameter.KEYWORD_ONLY
        kept[name] = Parameter(name, kind, default=told.default, annotation=told.kind)

    def place(each: Parameter) -> tuple[int, int, bool]:
        """Return what parameters are sorted by, which is stable."""
        listed = each.kind is Parameter.POSITIONAL_OR_KEYWORD and each.name in options
        return each.kind, order.index(each.name) if listed else -1, each.name not in options

    return own.replace(parameters=sorted(kept.values(), key=place))


def records_of(
    given: dict[str, Any],
    function: str,
    *records: Any,
    defaults: Mapping[str, Any] | None = None,
) -> list[Any]:
    """Return records of the options that a function was given, which are taken out of ``given``.

    ``settings``, where they are among it, say some of them; ``defaults`` are others than declared.
    """
    settings = given.pop("settings", None)
    if not isinstance(settings, Settings | None):
        raise InvalidArgumentTypeError(f"settings must be a pyvista_vdi.Settings; got {settings!r}")
    said = dict(defaults or {})
    if settings is not None:
        known = [name for name, told in declared(*records).items() if told.setting]
        if without := [name for name in settings.given if name not in known]:
            raise InvalidArgumentError(
                f"{', '.join(without)} of the settings means nothing to {function}, which has "
                f"{', '.join(sorted(known))}: leave it out"
            )
        said |= settings.said
    made = []
    for each in records:
        found = {}
        for name, told in each.declared.items():
            if name in given and not told.setting:
                found[name] = given.pop(name)
            elif name in said:
                found[name] = said[name]
        made.append(each.checked(**found))
    return made


def names_of(*records: Any) -> list[str]:
    """Return the arguments that records of options bring, ``settings`` among them."""
    return [n for n, told in declared(*records).items() if not told.setting] + ["settings"]


def _documented(text: str, options: Iterable[Option]) -> str:
    """Return a docstring with entries behind those of its parameters, for what they lack."""
    section = re.search(r"\n( +)(Returns|Raises)\n", text)
    at, margin = (section.start(), len(section[1])) if section else (len(text), 4)
    head, tail = text[:at], text[at:]
    described = {
        name
        for names in re.findall(rf"^ {{{margin}}}(\w[\w, *]*?)(?: :.*)?$", head, re.MULTILINE)
        for name in names.split(", ")
    }
    new = entries((each for each in options if each.name not in described), margin)
    if "Parameters\n" not in head:
        new = f"\n{' ' * margin}Parameters\n{' ' * margin}----------\n{new}"
    return head.rstrip() + "\n" + new + tail
