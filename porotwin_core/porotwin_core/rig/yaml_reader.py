"""Reads YAML 1.2, and refuses a repeated key in a section; writes YAML that reads the same.

PyYAML follows version 1.1: `no` and `off` are truth values, `1:30` is the number 90, `010` is 8 and
`1e-3` is a text. This would surprise the owner of a rig.

The library ruamel.yaml 0.19 follows version 1.2 and was tried. It reads `1_000` as a number, keeps
keys such as 1 as numbers, writes the text `no` without quotes, names one line of a repeated key,
and parses in Python, several times slower. The checks of keys, lines and aliases would stay;
only the four patterns below would go.
"""

import re
import sys
from pathlib import Path
from typing import Any

import yaml

from porotwin_core.basis.declared_size import check_declared
from porotwin_core.basis.errors import InputError
from porotwin_core.basis.regular_file import read_regular
from porotwin_core.basis.remark import QUOTED

LARGEST_TEXT = 2 << 20
"""Longest document [bytes], and most values in it, repeated aliases included: 20 s of work."""

_FLOAT = re.compile(
    r'^[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?$'
    r'|^[-+]?\.(?:inf|Inf|INF)$|^\.(?:nan|NaN|NAN)$'
)
_INTEGER = re.compile(r'^[-+]?[0-9]+$|^0o[0-7]+$|^0x[0-9a-fA-F]+$')
_TRUTH = re.compile(r'^(?:true|True|TRUE|false|False|FALSE)$')
_REPLACED = {'tag:yaml.org,2002:float', 'tag:yaml.org,2002:int', 'tag:yaml.org,2002:bool'}
_MERGE = 'tag:yaml.org,2002:merge'
_TEXT = 'tag:yaml.org,2002:str'


class _Loader(yaml.CSafeLoader):
    """A safe loader with the numbers and truth values of YAML 1.2.

    Its parser is libyaml, which every wheel of PyYAML has: seven times faster than Python.
    """

    def get_single_node(self) -> yaml.Node | None:
        """Return the document as nodes; refuse one with too many repeated aliases."""
        node: yaml.Node | None = super().get_single_node()
        if node is not None:
            check_declared('it', (_values(node, {}),), most=LARGEST_TEXT, unit='values')
        return node

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        """Return the value of `node`; name the line of a word that its tag does not allow."""
        try:
            return super().construct_object(node, deep=deep)
        except (AttributeError, LookupError):  # PyYAML expects a right word
            kind = node.tag.rpartition(':')[2]
            raise yaml.MarkedYAMLError(
                problem=f"'{str(node.value)[:QUOTED]}' is no {kind}", problem_mark=node.start_mark
            ) from None

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Return the section `node` with its keys as texts; refuse a repeated key."""
        seen: dict[str, int] = {}
        for key_node, _ in node.value:
            if not isinstance(key_node, yaml.ScalarNode) or key_node.tag == _MERGE:
                continue
            key, line = key_node.value, key_node.start_mark.line + 1
            if key in seen:
                raise yaml.MarkedYAMLError(
                    problem=f"the key '{key}' stands twice, in the lines {seen[key]} and {line}; "
                    'keep one of them'
                )
            seen[key] = line
            key_node.tag = _TEXT
        return super().construct_mapping(node, deep=deep)


def _values(node: yaml.Node, known: dict[int, int]) -> int:
    """Return the number of values in a node, repeated ones counted again; `known` by identity."""
    if isinstance(node, yaml.ScalarNode):
        return 1
    if id(node) not in known:
        known[id(node)] = LARGEST_TEXT + 1  # inside itself it has no end
        below = node.value
        if isinstance(node, yaml.MappingNode):
            below = [part for pair in node.value for part in pair]
        known[id(node)] = 1 + sum(_values(part, known) for part in below)
    return known[id(node)]


def _integer(loader: yaml.SafeLoader, node: yaml.ScalarNode) -> int:
    word = loader.construct_scalar(node)
    return int(word, 0) if word.startswith(('0o', '0x')) else int(word)  # 010 is ten


_Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag not in _REPLACED]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}
_Loader.add_implicit_resolver('tag:yaml.org,2002:bool', _TRUTH, list('tTfF'))
_Loader.add_implicit_resolver('tag:yaml.org,2002:int', _INTEGER, list('-+0123456789'))
_Loader.add_implicit_resolver('tag:yaml.org,2002:float', _FLOAT, list('-+0123456789.'))
_Loader.add_constructor('tag:yaml.org,2002:int', _integer)


class _Dumper(yaml.SafeDumper):
    """A safe dumper that also quotes texts such as 2e1 and 0o7, numbers of YAML 1.2 alone."""


_Dumper.add_implicit_resolver('tag:yaml.org,2002:float', _FLOAT, list('-+0123456789.'))
_Dumper.add_implicit_resolver('tag:yaml.org,2002:int', _INTEGER, ['0'])


def yaml_text(data: Any) -> str:
    """Return `data` as a YAML document that `read_yaml` reads; keys stay in their order."""
    text: str = yaml.dump(
        data, Dumper=_Dumper, sort_keys=False, default_flow_style=None, allow_unicode=True
    )
    return text


def read_yaml(text: str) -> Any:
    """Return the content of a YAML document.

    Raises:
        yaml.YAMLError: no YAML, or a repeated key in a section.
        InputError: it is too large.
    """
    check_declared('it', (len(text),), most=LARGEST_TEXT)
    _check_depth(text)
    return yaml.load(text, Loader=_Loader)  # a safe loader


def _check_depth(text: str) -> None:
    """Raise RecursionError where libyaml, which does not ask for room, would end the process."""
    depth = 0
    for event in yaml.parse(text, Loader=yaml.CSafeLoader):
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > sys.getrecursionlimit():
            raise RecursionError


def read_yaml_file(path: Path, *, remedy: str) -> Any:
    """Return the content of the YAML file `path`.

    Args:
        path: the file.
        remedy: how to get such a file, for the line about one that is missing.

    Raises:
        InputError: the file is missing, not readable, or no YAML; one line with the remedy.
    """
    try:
        data = read_regular(path, LARGEST_TEXT + 1)
        check_declared(path, (len(data),), most=LARGEST_TEXT)
        return read_yaml(data.decode('utf-8-sig'))
    except IsADirectoryError:
        raise InputError(f'{path}: is a folder; name a file in it') from None
    except FileNotFoundError:
        raise InputError(f'{path}: no such file; {remedy}') from None
    except UnicodeDecodeError:
        raise InputError(f'{path}: not a text in UTF-8; save it as UTF-8') from None
    except RecursionError:
        raise InputError(f'{path}: its sections are nested too deeply; correct it') from None
    except OSError as error:
        raise InputError(
            f'{path}: cannot be read ({error.strerror}); name a file that you may read'
        ) from None
    except (ValueError, yaml.YAMLError) as error:
        raise InputError(f'{path}: not readable as YAML: {" ".join(str(error).split())}') from None
