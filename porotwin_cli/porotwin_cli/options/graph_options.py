"""Options of a command that are the choices for the node graph, `GraphSettings`."""

import dataclasses
import functools
import inspect
from collections.abc import Callable, Collection, Mapping
from typing import Annotated, Any, get_type_hints

import typer

from porotwin_hub.launching.graph import GraphSettings, description_of


def graph_options(
    *, without: Collection[str], defaults: Mapping[str, Any]
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator that makes the first argument of a command, the settings, from options.

    Each field of the settings becomes an option, with its default, limits and description. A field
    that the command has as an argument of its own stays the argument.

    Args:
        without: fields that the command sets.
        defaults: other defaults of this command.
    """

    def decorated(command: Callable[..., None]) -> Callable[..., None]:
        own = inspect.signature(command, eval_str=True).parameters
        fields = [
            item
            for item in dataclasses.fields(GraphSettings)
            if item.name not in own and item.name not in without
        ]
        arguments = [
            *(_argument(item, defaults.get(item.name, item.default)) for item in fields),
            *list(own.values())[1:],
        ]

        @functools.wraps(command)
        def called(**values: Any) -> None:
            settings = GraphSettings(**{item.name: values.pop(item.name) for item in fields})
            command(settings, **values)

        called.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
            [item.replace(kind=inspect.Parameter.KEYWORD_ONLY) for item in arguments]
        )
        called.__annotations__ = {item.name: item.annotation for item in arguments}
        return called

    return decorated


def _argument(item: 'dataclasses.Field[Any]', default: Any) -> inspect.Parameter:
    """Return a field of the settings as an argument that typer makes an option of."""
    option = typer.Option(
        help=description_of(item.name),
        min=item.metadata.get('least'),
        max=item.metadata.get('most'),
    )
    return inspect.Parameter(
        item.name,
        inspect.Parameter.KEYWORD_ONLY,
        default=inspect.Parameter.empty if default is dataclasses.MISSING else default,
        annotation=Annotated[get_type_hints(GraphSettings)[item.name], option],
    )
