"""What in an OpenFOAM case can run code, found before any program of OpenFOAM sees the case.

A dictionary may hold C++ that OpenFOAM compiles (``#codeStream``, ``#calc``, ``coded...`` conditions,
sources and function objects), load libraries (``libs``), call the shell (``systemCall``) or take in
other files (``#include``). `refuse_code` reads every dictionary of a case, packed ones too, token by
token, and refuses what it finds as well as what it does not know: an unknown directive, an inclusion
from outside the case, text that this tokenizer and OpenFOAM's could read in two ways.

The cases of foam_cases/ pass by the same rules, so no name and no place makes a case trusted. Three
things pass that look dangerous and are not:

* ``#eval`` is arithmetic: it gives numbers and knows no functions beyond those of mathematics;
* ``libs (utilityFunctionObjects)``, by that bare name only: the library is OpenFOAM's own, the loader
  looks for it on the system's paths, and cases need it to end at rest; what in it runs code
  (``systemCall``, ``coded``, ``timeActivatedFileUpdate``) is refused by its own name;
* scripts (Allrun, Allclean) with exactly the text of those in foam_cases/.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from itertools import islice, pairwise
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.flow.cases import BUILT_IN
from ellipsoid_coupling.flow.foam_tokens import Token, line_of, tokens
from ellipsoid_coupling.inputs import is_ordinary, read_bytes, unpack
from ellipsoid_coupling.limits import (
    MOST_DICTIONARIES,
    MOST_DICTIONARY_BYTES,
    MOST_NESTING,
)

INPUT_FOLDERS = ("0.orig", "constant", "system")
# blockMesh makes the mesh anew: this folder is not copied.
LEFT_OUT = "polyMesh"

_OWN_LIBRARY = re.compile(r'"?(lib)?utilityFunctionObjects(\.so)?"?')
# Names that make OpenFOAM compile, load or call something, wherever they stand.
_CODE = re.compile(
    r"(?<!\w)(coded\w*|\w*CodedSource|codeStream|code(Include|Options|Libs|Execute|Write|End|Read"
    r"|Data|Context)?|localCode|dynamicCode|systemCall|(execute|write|end)Calls"
    r"|allowSystemOperations|timeActivatedFileUpdate|functionObjectLibs|libs)(?!\w)"
)
_INCLUDES = ("#include", "#includeIfPresent", "#sinclude")
_INSTALLED = ("#includeEtc", "#sincludeEtc", "#includeFunc")
# Directives that choose among or mark what stands in the same file, and run nothing.
_HARMLESS = ("#if", "#ifeq", "#else", "#endif", "#inputMode", "#remove", "#default")
_CODE_DIRECTIVES = ("#calc", "#codeStream")
# $name and ${name}; nested braces and ${name:-text} can put a name together from parts.
_PLAIN_VARIABLE = re.compile(r"\$(\{[\w.:]+\}|[\w.:!]+)")
# What a quoted key needs to stand for others than itself.
_PATTERN = re.compile(r"[.*+?|\[\](){}\\^$]")


class Finding(NamedTuple):
    """A construct that can run code: the file below the case, the line in it, what it is."""

    file: str
    line: int
    what: str


class _File(NamedTuple):
    """A dictionary: its name below the case, its content, unpacked."""

    name: str
    data: bytes

    def finding(self, token: Token, what: str) -> Finding:
        return Finding(self.name, line_of(self.data, token.start), what)


def refuse_code(case: Path) -> None:
    """InputError, with file and line, for a case that has anything that can run code.

    Reads 0.orig, constant and system of `case`, and its scripts; writes and runs nothing.
    """
    found = list(islice(find_code(case), 100))
    if not found:
        return
    first = found[0]
    more = f" (and {len(found) - 1} more such places)" if len(found) > 1 else ""
    raise InputError(
        f"{case / first.file}, line {first.line}", "a case that cannot run code",
        f"{first.what}{more}",
        "Read the case; if you trust it, solve it with: ellipsoid flow CASE --trust.",
    )  # fmt: skip


def find_code(case: Path) -> Iterator[Finding]:
    """Everything in a case that can run code, or that could not be told from it."""
    yield from _scripts(case)
    files = _dictionaries(case)
    for file in files:
        yield from _in_dictionary(file)
    yield from _circles(files)


def _scripts(case: Path) -> Iterator[Finding]:
    """Scripts and compiled code beside the folders; nothing here starts them, but somebody may."""
    for path in sorted(case.iterdir()):
        if path.name == "dynamicCode":
            yield Finding(path.name, 1, "a folder of compiled code")
        if not is_ordinary(path):
            continue
        with path.open("rb") as file:
            start = file.read(4)
        if path.suffix == ".so" or start == b"\x7fELF":
            yield Finding(path.name, 1, "compiled code")
        elif path.name.startswith("All") or start.startswith(b"#!"):
            data = read_bytes(path, "a script of a case", MOST_DICTIONARY_BYTES)
            if data not in [own.read_bytes() for own in BUILT_IN.glob(f"*/{path.name}")]:
                yield Finding(path.name, 1, "a script")


def _dictionaries(case: Path) -> list[_File]:
    """Every file that a run would copy; InputError for links to folders, pipes, or too much."""
    files, left = [], MOST_DICTIONARY_BYTES
    for part in INPUT_FOLDERS:
        for folder, inner, names in os.walk(case / part, onerror=_unreadable):
            inner[:] = sorted(name for name in inner if name != LEFT_OUT)
            for link in (Path(folder, name) for name in inner if Path(folder, name).is_symlink()):
                raise InputError(
                    str(link), "a case without links to folders", "such a link",
                    "Put the files themselves there.",
                )  # fmt: skip
            for path in (Path(folder, name) for name in sorted(names) if name != LEFT_OUT):
                data = read_bytes(path, "a dictionary of a case", left)
                if path.suffix == ".gz":
                    data = unpack(data, path, "a dictionary of a case", left)
                left -= len(data)
                files.append(_File(path.relative_to(case).as_posix(), data))
                if len(files) > MOST_DICTIONARIES:
                    raise InputError(
                        str(case), f"a case of at most {MOST_DICTIONARIES} files", "more",
                        "Name the case alone, without other data in its folders.",
                    )  # fmt: skip
    return files


def _unreadable(error: OSError) -> None:
    raise InputError(
        str(error.filename), "a folder of a case", error.strerror or "an error", "Check the path."
    )


def _in_dictionary(file: _File) -> Iterator[Finding]:
    """What in one file can run code; stops at text that no dictionary has."""
    stream = list(tokens(file.data))
    depth = 0
    for i, token in enumerate(stream):
        if token.kind == "mark":
            depth += (token.text in "{([") - (token.text in "})]")
            if depth > MOST_NESTING:
                yield file.finding(token, f"parts nested more than {MOST_NESTING} deep")
                return
            continue
        following = [other.text for other in stream[i + 1 : i + 12]]
        what = _what(file, token, following)
        if what is not None:
            yield file.finding(token, what)
    if re.search(rb"\bformat\s+\"?binary", file.data[:2000]):
        yield Finding(file.name, 1, "a binary file, in which code cannot be told from numbers")


def _what(file: _File, token: Token, following: list[str]) -> str | None:
    """Why a token is refused; None if it is not. `following` are the next tokens' texts."""
    text = token.text
    if token.kind == "odd":
        return f"text that no dictionary has ({text!r})"
    if token.kind == "directive":
        return _directive(file, token, following)
    if token.kind == "string":
        return _string(text[1:-1], following)
    if token.kind == "variable" and not _PLAIN_VARIABLE.fullmatch(text):
        return f"an expansion that can put names together, {text}"
    if token.kind == "word" and "$" in text:
        return f"an expansion within a word, {text}"
    # In a name, '/' belongs to it for OpenFOAM: what looks like a comment here may not be one there.
    if token.kind != "verbatim" and file.data[token.end : token.end + 1] == b"/":
        return f"a comment that touches {text}"
    found = None if token.kind == "verbatim" else _CODE.search(text)
    if found is None or (found[0] == "libs" and _own_libraries(following)):
        return None
    return found[0]


def _own_libraries(following: list[str]) -> bool:
    """Whether `libs` is followed by a list of nothing but the library that cases need."""
    if following[:1] != ["("] or ")" not in following:
        return False
    names = following[1 : following.index(")")]
    return bool(names) and all(_OWN_LIBRARY.fullmatch(name) for name in names)


def _string(content: str, following: list[str]) -> str | None:
    """A string may be a file, an expression, a word in quotes or a pattern for keys."""
    # OpenFOAM counts backslashes differently, and strips what a word may not have.
    if "\\\\" in content:
        return "a string with two backslashes, which may end elsewhere for OpenFOAM"
    bare = re.sub(r"[\s\\\"'/;{}]", "", content)
    if _CODE.fullmatch(bare):
        return bare
    for variable in re.findall(r"\$(?:\{[^}]*\}|[^\s;{}()]*)", content):
        if not _PLAIN_VARIABLE.match(variable) or ":-" in variable or ":+" in variable:
            return f"an expansion that can put names together, {variable}"
    # "l.*s" (...); would stand for libs, too. With { it is a dictionary, as patches have.
    names = (
        following[1 : following.index(")")] if following[:1] == ["("] and ")" in following else []
    )
    loads = any(re.match(r'["A-Za-z_$]', name) for name in names)
    file_like = bool(following) and (".so" in following[0] or "/" in following[0])
    if _PATTERN.search(content) and (loads or file_like):
        return f'a pattern for keys that may stand for libs, "{content}"'
    return None


def _directive(file: _File, token: Token, following: list[str]) -> str | None:
    """Directives that run code, take in what was not read here, or are unknown."""
    name, target = token.text, (following[0] if following else "").strip('"')
    if name in _CODE_DIRECTIVES:
        return name
    if name == "#eval":
        return _eval(file, token)
    if name in _INCLUDES and _inside(file, target) is None:
        return f"{name} of a file outside the case, {target}"
    if name in _INSTALLED and not re.fullmatch(r"\w[\w.-]*(/\w[\w.-]*)*", target):
        return f"{name} of a file outside the installation, {target}"
    if name not in (*_INCLUDES, *_INSTALLED, *_HARMLESS):
        return f"the unknown directive {name}"
    return None


def _eval(file: _File, token: Token) -> str | None:
    """#eval { ... } is read up to the next brace, comments and strings included."""
    found = re.compile(rb"\s*\{([^}]*)\}?").match(file.data, token.end)
    if found and (re.search(rb"[\"'{;#\\]|//|/\*", found[1]) or not found[0].endswith(b"}")):
        return "#eval of more than an expression"
    return None


def _inside(file: _File, target: str) -> str | None:
    """The file below the case that an #include in `file` means; None if it is none of those read."""
    for start, place in (("<case>/", ""), ("<system>/", "system/"), ("<constant>/", "constant/")):
        if target.startswith(start):
            return _inside(_File("case", b""), place + target.removeprefix(start))
    if not re.fullmatch(r"[\w.+-]+(/[\w.+-]+)*", target):
        return None
    path = os.path.normpath(PurePosixPath(file.name).parent / target)
    parts = PurePosixPath(path).parts
    # A run starts from a copy of 0.orig that is called 0.
    path = path.replace("0/", "0.orig/", 1) if parts[0] == "0" else path
    known = parts[0] in (*INPUT_FOLDERS, "0") and len(parts) > 1 and LEFT_OUT not in parts
    return path if known else None


def _circles(files: list[_File]) -> Iterator[Finding]:
    """Files that include themselves, by way of others or not: OpenFOAM reads those for ever."""
    edges: dict[str, list[tuple[str, Finding]]] = {}
    for file in files:
        stream = list(tokens(file.data))
        for token, following in pairwise(stream):
            target = _inside(file, following.text.strip('"')) if token.text in _INCLUDES else None
            if target is not None:
                finding = file.finding(token, f"a circle of #include over {target}")
                edges.setdefault(file.name.removesuffix(".gz"), []).append((target, finding))
    for start in edges:
        seen, open_ = set(), [start]
        while open_:
            for target, finding in edges.get(open_.pop(), []):
                if target == start:
                    yield finding
                    return
                if target not in seen:
                    seen.add(target)
                    open_.append(target)
