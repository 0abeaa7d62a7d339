"""Functions whose arguments are options: their signature, their docstring, and what they refuse."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field, make_dataclass
from functools import wraps
from inspect import Parameter
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError, InvalidArgumentTypeError
from pyvista_vdi.model.checks import suggestion
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
    for name in given:
        if name in known:
            continue
        elsewhere = (each.elsewhere for each in RECORDS if name in vars(each)["declared"])
        hint = next(filter(None, elsewhere), suggestion(name, known))
        if "settings" in known and name in Settings.declared:
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


def takes(
    *,
    order: Iterable[str] = (),
    aliases: Mapping[str, str] | None = None,
    returns: Mapping[str, Any] | None = None,
    kinds: Mapping[str, str] | None = None,
    without: Iterable[str] = (),
    **records: Any,
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Make the options of records the arguments of a function, which gets the records.

    The function has a parameter for each record, by the names of ``records``, or ``**asked`` for
    all of them. Its signature then has the options instead, by keyword, or where ``order`` has
    their names as positional arguments of that order; and its docstring an entry for each that it
    does not describe itself. ``aliases`` are other names that are taken as well. ``returns``: what
    the function returns, by the values of an option; ``kinds``: types of arguments that are others
    than declared; ``without``: options that are not taken. What is seldom turned is taken as
    ``settings``.
    """
    options = {n: told for n, told in declared(*records.values()).items() if n not in without}
    if hidden := sorted([name for name, told in options.items() if told.setting]):
        options = {name: told for name, told in options.items() if not told.setting}
        what = f"options that are seldom turned; here {', '.join(hidden)}"
        options["settings"] = Option("settings", None, what, kind="Settings | None")
    other = aliases or {}

    def decorated(function: Callable[..., Any]) -> Callable[..., Any]:
        own = inspect.signature(function)
        kept = [each for each in own.parameters.values() if each.name not in (*records, "asked")]
        made = [each for each in kept if each.kind is Parameter.POSITIONAL_OR_KEYWORD]
        by_name = kept[len(made) :]
        listed = [name for name in order if name in options]
        for name in dict.fromkeys([*listed, *options]):
            told = options[name]
            kind = Parameter.POSITIONAL_OR_KEYWORD if name in listed else Parameter.KEYWORD_ONLY
            of = (kinds or {}).get(name, told.kind)
            made.append(Parameter(name, kind, default=told.default, annotation=of))
        signature = own.replace(parameters=[*made, *by_name])
        named = signature.parameters
        open_ended = bool(by_name) and by_name[-1].kind is Parameter.VAR_KEYWORD
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
            taken = {name: given.pop(name) for name in options.keys() & given.keys()}
            made = records_of(taken, called_by, *records.values(), without=without)
            return function(**given, **dict(zip(records, made, strict=True)))

        # The docstring describes options behind the parameters, those apart that it has already
        text = function.__doc__ or ""
        section = re.search(r"\n( +)(Returns|Raises)\n", text)
        at, margin = (section.start(), len(section[1])) if section else (len(text), 4)
        pattern = rf"^ {{{margin}}}(\w[\w, *]*?)(?: :.*)?$"
        described = ", ".join(re.findall(pattern, text[:at], re.MULTILINE)).split(", ")
        new = entries([options[name] for name in options if name not in described], margin)
        vars(called).update(__signature__=signature, returns=returns)
        called.__doc__ = text[:at].rstrip() + "\n" + new + text[at:]
        return called

    return decorated


def records_of(
    given: Mapping[str, Any],
    function: str,
    *records: Any,
    defaults: Mapping[str, Any] | None = None,
    without: Iterable[str] = (),
    others: Iterable[str] | None = None,
) -> list[Any]:
    """Return records of the options that a function was given; TypeError for what none has.

    ``settings``, where they are among it, say some of them, but for those ``without`` which it
    does; ``defaults`` are others than declared. ``others`` are the function's other arguments,
    which the error may suggest.
    """
    taken = [told for told in declared(*records).values() if told.name not in without]
    names = [told.name for told in taken if not told.setting]
    turned = sorted([told.name for told in taken if told.setting])
    names += ["settings"] * bool(turned)
    if not given.keys() <= {*names}:
        refuse_unknown(given, function, (*names, *(others or ())))
    settings = given.get("settings")
    if not isinstance(settings, Settings | None):
        raise InvalidArgumentTypeError(f"settings must be a pyvista_vdi.Settings; got {settings!r}")
    said = dict(defaults or {})
    if settings is not None:
        if vain := [name for name in settings.given if name not in turned]:
            raise InvalidArgumentError(
                f"{', '.join(vain)} of the settings means nothing to {function}, which has "
                f"{', '.join(turned)}: leave it out"
            )
        said |= settings.said
    said |= {name: given[name] for name in names if name in given}
    return [each(**{n: said[n] for n in each.declared if n in said}) for each in records]
