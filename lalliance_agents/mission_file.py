"""A mission file: from text to a checked `Mission`, or to one sentence that names the line and what was expected there.

YAML becomes plain values (text, numbers, truth values, lists, mappings), and every value keeps its place: the line, and
how it is spelled there. What YAML allows and a mission must not contain is refused here: keys that occur twice or are
no text, tags, dates, numbers that YAML reads otherwise than people do, aliases that contain themselves or unfold
without end. Then the record checks the values (`config`), and `mission_errors` tells what it found. Options of the
environment are checked later, by the environment; `MissionText.error` tells those errors in the same words.

    missions/depot.yaml:12: robots.lifter.tasks.crate-1: -3 is not allowed; expected a number greater than 0
"""

import json
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, ValidationError
from pydantic_core import PydanticCustomError

from lalliance_agents.config import Mission
from lalliance_agents.errors import MissionError
from lalliance_agents.faults import AnyFault, Fault
from lalliance_agents.mission_errors import Finding, Place, Spot, dotted, explain, kind_of, line_of, one_line, short
from lalliance_agents.model.parameters import Record

LARGEST = 2**20
"""Longest mission file, in bytes."""
MOST_VALUES = 200_000
"""Values in a mission once its aliases are unfolded."""
DEEPEST = 50
"""Levels of lists and mappings inside one another."""

_TAG = "tag:yaml.org,2002:"
_TOO_LARGE = f"larger than {LARGEST} bytes; expected a mission file"
_TRUTH = {"yes": True, "true": True, "on": True, "no": False, "false": False, "off": False}


def load_mission(path: Path) -> Mission:
    """The mission in the file at `path`.

    Raises:
        MissionError: the file cannot be read, or does not hold a mission.
    """
    return load_mission_text(path).mission()


def parse_mission(text: str, source: str) -> Mission:
    """The mission in `text`; errors call it `source`.

    Raises:
        MissionError: the text does not hold a mission.
    """
    return MissionText(text, source).mission()


#: A string of JSON, or a number that is none, which Python writes into JSON all the same.
_STRING_OR_NO_NUMBER = re.compile(r'"(?:[^"\\]|\\.)*"|-?Infinity|NaN')
_IN_YAML = {"Infinity": ".inf", "-Infinity": "-.inf", "NaN": ".nan"}


class _OneFault(Record):
    """A document that holds one fault."""

    fault: AnyFault


def read_fault(text: str) -> Fault:
    """The fault in `text`, which spells it as JSON in the fields of a mission file; `at` may be left out.

    Raises:
        MissionError: the text does not hold a fault; the sentence names the field, the value and what was expected.
    """
    source = "command"
    try:
        content = json.loads(text)
        document = {"fault": {"at": 0, **content} if isinstance(content, dict) else content}
        spelled = json.dumps(document, ensure_ascii=False)
        spelled = _STRING_OR_NO_NUMBER.sub(lambda found: _IN_YAML.get(found[0], found[0]), spelled)
        holder = MissionText(spelled, source)
        try:
            return _OneFault.model_validate_json(json.dumps(holder.document), strict=True).fault
        except ValidationError as error:
            raise holder.error(error, _OneFault) from None
    except MissionError as error:
        sentence = str(error).removeprefix(f"{source}:1: ").removeprefix("fault.").removeprefix("fault: ")
        raise MissionError(sentence) from None
    except (ValueError, RecursionError):
        raise MissionError(f"{short(text)!r} is not a fault; expected JSON with the fields of a mission file") from None


def read_value(text: str) -> Any:
    """The plain value that `text` spells as it would stand in one line of a mission file.

    Raises:
        MissionError: it is not readable, or not as one value.
    """
    source = "value"
    try:
        document = MissionText(f"{source}: {text}", source).document
    except MissionError as error:
        place = re.compile(rf"{source}:1(:\d+)?: ({source}\b[^:]*: )?")
        raise MissionError(place.sub("", str(error), count=1)) from None
    if list(document) != [source]:
        raise MissionError("more than one value; expected it in one line")
    return document[source]


def load_mission_text(path: Path) -> "MissionText":
    """The file at `path`, read and not yet checked: for callers that have further errors to report on it.

    Raises:
        MissionError: the file cannot be read, or is no YAML mapping.
    """
    raw = b""
    try:
        if path.exists() and not path.is_file() and not path.is_dir():
            raise MissionError(one_line(f"{path}: not a regular file; expected a mission file"))
        with path.open("rb") as file:
            raw = file.read(LARGEST + 1)
        if len(raw) <= LARGEST:
            return MissionText(raw.decode(), str(path))
        reason = _TOO_LARGE
    except FileNotFoundError:
        reason = "no such file; expected a mission file"
    except IsADirectoryError:
        reason = "a directory; expected a mission file"
    except UnicodeDecodeError as error:
        line = raw.count(b"\n", 0, error.start) + 1
        reason = f"line {line} is not UTF-8, byte 0x{raw[error.start]:02x}; expected a text file in UTF-8"
    except (OSError, ValueError) as error:
        reason = f"cannot be read: {getattr(error, 'strerror', None) or error}"
    raise MissionError(one_line(f"{path}: {reason}"))


class MissionText:
    """The values of a mission file with their places: for the mission itself, and for sentences about it.

    Attributes:
        source: what errors call the file.
        document: the file as plain values.

    Raises:
        MissionError: on construction: the text is no YAML mapping, or uses what a mission must not contain.
    """

    def __init__(self, text: str, source: str) -> None:
        self.source = source
        reader = _Reader()
        self.document: Any = reader.read(self._tree(text), ())
        self._spots = reader.spots
        if reader.findings:
            raise self._report(reader.findings)
        if not isinstance(self.document, dict):
            found = kind_of(self.document)
            raise self.wrong((), f"the file holds {found}; expected a mapping with name, tasks and robots")

    def __repr__(self) -> str:
        return f"MissionText({self.source!r})"

    def mission(self) -> Mission:
        """The mission in the text.

        Raises:
            MissionError: the values do not make a mission.
        """
        try:
            return Mission.model_validate_json(json.dumps(self.document), strict=True)
        except ValidationError as error:
            raise self.error(error, Mission) from None
        except ArithmeticError:
            raise self.wrong(("parameters",), "holds numbers too large or too small to calculate with") from None

    def error(
        self, error: ValidationError | PydanticCustomError, record: type[BaseModel] = Mission, prefix: Place = ()
    ) -> MissionError:
        """What somebody found wrong with the values of this file, with file and line.

        Args:
            error: pydantic's, from making a `record`; or one made by `config.misplaced`.
            record: the record, whose fields are suggested for an unknown one.
            prefix: where the record's values stand; `("environment",)` for the options of an environment.
        """
        if isinstance(error, ValidationError):
            return self._report(explain(error.errors(include_url=False), record, self._spots, prefix))
        return self.wrong(tuple((error.context or {}).get("path", ())), error.message())

    def wrong(self, place: Place, sentence: str) -> MissionError:
        """The error that says `sentence` of the value at `place`, with file and line."""
        return self._report([Finding(line_of(place, self._spots), place, sentence)])

    def _tree(self, text: str) -> yaml.Node:
        if len(text.encode(errors="surrogatepass")) > LARGEST:
            raise MissionError(one_line(f"{self.source}: {_TOO_LARGE}"))
        where, problem = "", "the file is empty; expected a mission"
        try:
            tree: yaml.Node | None = _Loader(text).get_single_node()
            if tree is not None:
                return tree
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            where = f":{mark.line + 1}:{mark.column + 1}" if mark else ""
            problem = "not readable as YAML: " + ", ".join(filter(None, (error.context, error.problem)))
            problem += next((f"; {remedy}" for found, remedy in _REMEDIES.items() if found in problem), "")
        except yaml.reader.ReaderError as error:
            start = text.rfind("\n", 0, error.position) + 1
            where = f":{text.count(chr(10), 0, start) + 1}:{error.position - start + 1}"
            problem = f"not readable as YAML: the character {text[error.position]!r} is not allowed"
        raise MissionError(one_line(f"{self.source}{where}: {problem}"))

    def _report(self, findings: Iterable[Finding]) -> MissionError:
        ordered = sorted(dict.fromkeys(findings), key=lambda finding: finding.line)
        first, more = ordered[0], f" (and {len(ordered) - 1} more)" if len(ordered) > 1 else ""
        place = f"{dotted(first.place)}: " if first.place else ""
        return MissionError(one_line(f"{self.source}:{first.line}: {place}{first.sentence}{more}"))


#: How to mend what YAML complains of in words of its own, by a part of these.
_REMEDIES = {
    "character '\\t'": "expected spaces instead of the tab",
    "mapping values are not allowed": "expected a space after each colon, quotes around text with a colon, and the entries "
    "of one mapping at the same indentation",
    "expected <block end>": "expected the entries of one mapping or list at the same indentation",
}


class _Loader(yaml.SafeLoader):
    """YAML 1.1 up to a depth; that 1e3 is a number comes from YAML 1.2."""

    depth = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        self.depth += 1
        if self.depth > DEEPEST:
            mark = parent.start_mark if parent else None
            raise yaml.composer.ComposerError(None, None, f"nested deeper than {DEEPEST} levels", mark)
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


_Loader.add_implicit_resolver(
    f"{_TAG}float", re.compile(r"^[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$"), list("-+.0123456789")
)


class _Reader:
    """One walk over the tree of nodes: what it holds as plain values, where, and what a mission must not contain."""

    def __init__(self) -> None:
        self.spots: dict[Place, Spot] = {}
        self.findings: list[Finding] = []
        self._count = 0
        self._open: set[int] = set()

    def read(self, node: yaml.Node, place: Place, key_line: int | None = None) -> Any:
        """The plain value of `node`; None where it cannot be one, which is then among the findings."""
        self._count += 1
        if self._count > MOST_VALUES or id(node) in self._open:
            if self._count <= MOST_VALUES + 1:
                endless = "contains itself" if id(node) in self._open else f"unfolds to more than {MOST_VALUES} values"
                self._refuse(node, place, f"{endless}; expected a mission without such aliases")
            return None
        self._open.add(id(node))
        line = node.start_mark.line + 1 if key_line is None or isinstance(node, yaml.ScalarNode) else key_line
        self.spots[place] = Spot(line, None)
        value = self._value(node, place)
        self.spots[place] = Spot(line, value, node.value if isinstance(node, yaml.ScalarNode) else "")
        self._open.discard(id(node))
        return value

    def _value(self, node: yaml.Node, place: Place) -> Any:
        tag = node.tag.removeprefix(_TAG)
        if isinstance(node, yaml.MappingNode) and tag == "map":
            return self._mapping(node, place)
        if isinstance(node, yaml.SequenceNode) and tag == "seq":
            return [self.read(item, (*place, index)) for index, item in enumerate(node.value)]
        if isinstance(node, yaml.ScalarNode) and tag in _SCALARS:
            try:
                return _SCALARS[tag](node.value)
            except UnicodeEncodeError:
                self._refuse(node, place, f"{short(repr(node.value))} holds half a character; expected whole ones")
            except (ValueError, KeyError):
                shown = short(node.value)
                expected = f"a plain number like 12 or 0.5, or text in quotes: {shown!r}"
                self._refuse(node, place, f"{shown} is not read alike by all; expected {expected}")
        elif tag == "timestamp":
            shown = short(node.value)
            self._refuse(node, place, f"{shown} is a date in YAML; expected text in quotes: {shown!r}")
        else:
            shown = short(node.tag.replace(_TAG, "!!"))
            self._refuse(node, place, f"the tag {shown} is not allowed; expected a plain value")
        return None

    def _mapping(self, node: yaml.MappingNode, place: Place) -> dict[str, Any]:
        result: dict[str, Any] = {}
        lines: dict[str, int] = {}
        own = [pair for pair in node.value if pair[0].tag != f"{_TAG}merge"]
        for _, base in (pair for pair in node.value if pair[0].tag == f"{_TAG}merge"):
            self._merge(base, place, result)
        for key_node, value_node in own:
            key, line = self._key(key_node, place), key_node.start_mark.line + 1
            if key is None:
                continue
            if key in lines:
                where = f"lines {lines[key]} and {line}" if lines[key] < line else f"line {line}"
                sentence = f"given twice, in {where}; expected it once"
                self.findings.append(Finding(line, (*place, key), sentence))
                continue
            lines[key] = line
            result[key] = self.read(value_node, (*place, key), line)
        return result

    def _merge(self, node: yaml.Node, place: Place, result: dict[str, Any]) -> None:
        """Put what `<<: *base` names under the keys of a mapping; of several bases the first one wins."""
        bases = node.value[::-1] if isinstance(node, yaml.SequenceNode) else [node]
        for base in bases:
            value = self.read(base, place)
            if isinstance(value, dict):
                result.update(value)
            else:
                self._refuse(base, place, f"<< names {kind_of(value)}; expected a mapping")

    def _key(self, node: yaml.Node, place: Place) -> str | None:
        """The key, if it is text; else None, and a finding."""
        tag = node.tag.removeprefix(_TAG)
        if not isinstance(node, yaml.ScalarNode):
            self._refuse(node, place, "a list or a mapping cannot be a key; expected text")
        elif tag not in ("str", "value"):
            kind = {"bool": "a truth value", "null": "nothing", "timestamp": "a date"}.get(tag, "a number")
            shown = short(node.value)
            self._refuse(node, place, f"the key {shown} is {kind} in YAML; expected text in quotes: {shown!r}")
        else:
            return str(self._value(node, place))
        return None

    def _refuse(self, node: yaml.Node, place: Place, sentence: str) -> None:
        self.findings.append(Finding(node.start_mark.line + 1, place, sentence))


def _text(written: str) -> str:
    written.encode()
    return written


def _float(written: str) -> float:
    return float(re.sub(r"^([-+]?)\.(inf|nan)$", r"\1\2", written.replace("_", "").lower()))


#: How a scalar becomes a value. `int` refuses what YAML 1.1 would read as octal (010) or in sixties (10:00).
_SCALARS: dict[str, Callable[[str], Any]] = {
    "str": _text,
    "value": _text,
    "null": lambda _: None,
    "bool": lambda written: _TRUTH[written.lower()],
    "int": lambda written: int(written.replace("_", ""), 0),
    "float": _float,
}
