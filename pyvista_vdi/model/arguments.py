"""Functions whose arguments are options: their signature, their docstring, and what they refuse."""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field, make_dataclass
from functools import cache, wraps
from inspect import Parameter
from typing import Any

from pyvista_vdi.errors import InvalidArgumentError, InvalidArgumentTypeError
from pyvista_vdi.model import types
from pyvista_vdi.model.checks import suggestion
from pyvista_vdi.model.classification import Classification
from pyvista_vdi.model.options import (
    DrawingOptions,
    FrameRequest,
    GenerationOptions,
    GenerationRequest,
    Option,
    Options,
    RenderOptions,
)

#: What functions raise because of a parameter, by its name, and whatever they have.
_RAISES = {
    "": "TypeError\n    If a keyword is unknown.\n"
    "InvalidArgumentError\n    If an argument cannot be used.",
    "volume": "InvalidVolumeError\n    If it is no volume, or none that can be shown.",
    "vdi": "InvalidVDIError\n    If it is no VDI, or none that can be shown so.",
    "camera": "InvalidCameraError\n    If it is no view.",
    "blending": "UnsupportedError\n    If something is asked for that cannot be honoured.",
    "cmap": "MissingDependencyError\n"
    "    If a colour map or an opacity is named and PyVista is not installed.",
    "device": "NoDeviceError, DeviceMemoryError, DeviceError, KernelBuildError\n"
    "    If there is no device, or it fails.",
    "progress": "Cancelled\n    If ``progress`` returned ``False``.",
}


def refuse_unknown(given: Iterable[str], function: str, known: Iterable[str]) -> None:
    """Raise TypeError for the first argument whose name is not known, and say what is meant."""
    known = [name for name in known if name not in ("self", "look")]
    for name in given:
        if name in known:
            continue
        hint = suggestion(name, known)
        if name in Classification.declared:
            hint = (
                "this VDI's colours are fixed: give it to generate, or generate with "
                "classification='deferred', which keeps values"
            )
        elif "settings" in known and name in Settings.declared:
            hint = f"pass it by settings=pyvista_vdi.Settings({name}=...)"
        raise TypeError(f"{function}() got an unexpected keyword argument {name!r}: {hint}")


def documented(
    text: str | None, options: Mapping[str, Option], parameters: Mapping[str, Parameter]
) -> str:
    """Return a docstring that has entries for the options among some parameters, in their order.

    Entries of single parameters that it has stay; where it has no section Raises, it gets one.
    """
    head, *others = re.split(r"\n\n(?=[A-Z][a-z]+\n-+\n)", inspect.cleandoc(text or ""))
    sections = dict.fromkeys(("Parameters", "Returns", "Raises"), "")
    sections |= {each.partition("\n")[0]: each for each in others}
    described: dict[str, str] = {}
    for entry in re.split(r"\n(?=\w)", sections["Parameters"])[1:]:
        described[entry.partition(" :")[0]] = entry
    entries = ["Parameters\n----------"]
    for name, parameter in parameters.items():
        if name in options and name not in described:
            told = options[name]
            kind = told.kind.removesuffix(" | None")
            alias = getattr(types, kind, None)
            words = getattr(alias, "__metadata__", [kind.replace(" | ", " or ")])
            kind = '{"' + '", "'.join(told.choices) + '"}' if told.choices else words[0]
            optional = ", optional" if "None" in told.kind or parameter.default is None else ""
            said = f"{told.what[:1].upper()}{told.what[1:]}. {told.more}".rstrip()
            said = textwrap.indent(textwrap.fill(said, 96, break_long_words=False), "    ")
            described[name] = f"{name} : {kind}{optional}\n{said}"
        entries.append(described.get(name, ""))
    sections["Parameters"] = "\n".join(filter(None, entries))
    raised = [_RAISES[name] for name in ("", *parameters) if name in _RAISES]
    sections["Raises"] = sections["Raises"] or "\n".join(["Raises\n------", *raised])
    return "\n\n".join([head, *filter(None, sections.values())])


_DECLARED = GenerationOptions.declared | RenderOptions.declared | DrawingOptions.declared
#: Options that are seldom turned: functions take them as ``settings``.
_SELDOM = {
    name: _DECLARED[name]
    for name in (
        *("sample_distance", "memory_limit", "criterion", "tolerance", "view_cone"),
        *("transmittance_cutoff", "regenerate_below", "coverage"),
    )
}
_FIELDS = [(name, told.kind, field(default=told.default)) for name, told in _SELDOM.items()]
_Fields: Any = make_dataclass("_Fields", _FIELDS, bases=(Options,), frozen=True, kw_only=True)


class Settings(_Fields):  # type: ignore[misc]
    """Options that are seldom turned, for ``settings=`` of whatever has a use for them.

    Examples
    --------
    >>> import pyvista_vdi as pvdi
    >>> pvdi.Settings(tolerance=0.01, memory_limit=2**31).given
    {'memory_limit': 2147483648, 'tolerance': 0.01}
    """

    declared = _SELDOM
    __signature__ = inspect.signature(_Fields)
    __doc__ = documented(__doc__, _SELDOM, __signature__.parameters)

    def __init__(self, **given: Any) -> None:
        refuse_unknown(given, "Settings", self.declared)
        super().__init__(**given)
        # What was given, defaults among it
        object.__setattr__(self, "said", {name: getattr(self, name) for name in given})


@cache
def _arguments(
    *records: type[Options], without: tuple[str, ...] = ()
) -> tuple[dict[str, Option], list[str]]:
    """Return the options of records as arguments, by name, and those that ``settings`` has."""
    options: dict[str, Option] = {}
    for each in records:
        options |= each.declared
    for name in without:
        options.pop(name, None)
    if turned := sorted(options.keys() & Settings.declared.keys()):
        for name in turned:
            del options[name]
        what = f"options that are seldom turned; here {', '.join(turned)}"
        options["settings"] = Option("settings", None, what, kind="Settings | None")
    return options, turned


def takes(
    *,
    order: Iterable[str] = (),
    aliases: Mapping[str, str] | None = None,
    without: tuple[str, ...] = (),
    request: type[Options] = FrameRequest,
    **records: Any,
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Make the options of records the arguments of a function, which gets the records.

    The function has a parameter for each record, by the names of ``records``, or ``**asked`` for
    all of them. Its signature then has the options instead, by keyword, or where ``order`` has
    their names as positional arguments of that order, but for those ``without`` which it does, and
    those that it has parameters for itself. Its docstring gets an entry for each parameter that it
    does not describe; those that are no options are described by the ``request`` that is made of
    them. ``aliases`` are other names that are taken as well. What is seldom turned is taken as
    ``settings``.
    """
    other = aliases or {}

    def decorated(function: Callable[..., Any]) -> Callable[..., Any]:
        own = inspect.signature(function)
        left_out = (*without, *own.parameters)
        options, _ = _arguments(*records.values(), without=left_out)
        kept = [each for each in own.parameters.values() if each.name not in (*records, "asked")]
        made = [each for each in kept if each.kind is Parameter.POSITIONAL_OR_KEYWORD]
        by_name = kept[len(made) :]
        listed = [name for name in order if name in options]
        for name in dict.fromkeys([*listed, *options]):
            told = options[name]
            kind = Parameter.POSITIONAL_OR_KEYWORD if name in listed else Parameter.KEYWORD_ONLY
            made.append(Parameter(name, kind, default=told.default, annotation=told.kind))
        signature = own.replace(parameters=[*made, *by_name])
        named = signature.parameters
        open_ended = bool(by_name) and by_name[-1].kind is Parameter.VAR_KEYWORD
        called_by = "add_vdi" if function.__name__ == "__call__" else function.__name__

        @wraps(function)
        def called(*args: Any, **given: Any) -> Any:
            for alias in other.keys() & given.keys():
                given[other[alias]] = given.pop(alias)
            if wrong := [n for n in given if n in records or not (open_ended or n in named)]:
                refuse_unknown(wrong, called_by, (*named, *other))
            try:
                signature.bind(*args, **given)
            except TypeError as error:
                raise TypeError(f"{called_by}() {error}") from None
            given |= zip(named, args, strict=False)
            taken = {name: given.pop(name) for name in options.keys() & given.keys()}
            made = records_of(taken, called_by, *records.values(), without=left_out)
            return function(**given, **dict(zip(records, made, strict=True)))

        described = GenerationRequest.declared | FrameRequest.declared | request.declared
        for record in records.values():
            described |= record.declared
        called.__doc__ = documented(function.__doc__, described | options, named)
        vars(called).update(__signature__=signature)
        return called

    return decorated


def records_of(
    given: Mapping[str, Any],
    function: str,
    *records: Any,
    defaults: Mapping[str, Any] | None = None,
    without: tuple[str, ...] = (),
    others: Iterable[str] | None = None,
) -> list[Any]:
    """Return records of the options that a function was given; TypeError for what none has.

    ``settings``, where they are among it, say some of them, but for those ``without`` which it
    does; ``defaults`` are others than declared. ``others`` are the function's other arguments,
    which the error may suggest.
    """
    options, turned = _arguments(*records, without=without)
    if not given.keys() <= options.keys():
        refuse_unknown(given, function, (*options, *(others or ())))
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
    said |= given
    return [each(**{n: said[n] for n in each.declared.keys() & said.keys()}) for each in records]
