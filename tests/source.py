"""What source files hold: lines of code, constants, names, kinds of warnings, hidden state, private imports."""

import ast
import functools
import importlib
import io
import pkgutil
import re
import tokenize
from collections import defaultdict

import skthermo

GROUND = ("_core", "fem", "preprocessing", "residuals", "surrogate", "updating", "detection", "metrics", "datasets")
"""Rooms in which equal inputs give equal results, by their source."""
BUILT = {"generated", "gallery", "_build"}

BESIDE_CODE = {
    *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT),
    *(tokenize.ENCODING, tokenize.ENDMARKER),
}
HIDDEN = {  # names by which state is hidden, and what they look at
    "_getframe": "the caller's frames",
    "currentframe": "the caller's frames",
    "f_locals": "the caller's variables",
    "ContextVar": "context variables",
    "contextvars": "context variables",
    "weakref": "weak references",
    "catch_warnings": "filters of warnings",
}
OWN = {"self", "cls", "twin"}  # a twin is a copy that a method has just made


def public():
    """Names that users import: triples of package, name and thing."""
    for package in pkgutil.iter_modules(skthermo.__path__, "skthermo."):
        module = importlib.import_module(package.name) if package.ispkg and "._" not in package.name else None
        yield from ((package.name[9:], name, getattr(module, name)) for name in getattr(module, "__all__", ()))


@functools.cache
def tree_of(path):
    """Syntax tree of a file, which nothing changes."""
    return ast.parse(path.read_text())


def trees(package, rooms=None):
    """Syntax tree of each file, of some rooms only or of all, by its path within the package."""
    files = {path.relative_to(package): path for path in sorted(package.rglob("*.py"))}
    inside = {file for file in files if rooms is None or file.parts[0] in rooms}
    return {file.as_posix(): tree_of(files[file]) for file in files if file in inside}


def lines_of_code(text):
    """Number of lines without docstrings, comments and blank ones."""
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    lines = {n for one in tokens if one.type not in BESIDE_CODE for n in range(one.start[0], one.end[0] + 1)}
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Expr(value=ast.Constant(value=str())):
                lines -= set(range(node.lineno, node.end_lineno + 1))
    return len(lines)


def constants(tree, in_tuples=True):
    """Upper-case names that a module assigns, with their lines, those of tuples included or not."""
    for node in tree.body:
        match node:
            case ast.Assign(targets=targets):
                pass
            case ast.AnnAssign(target=target):
                targets = [target]
            case _:
                continue
        parts = [part for target in targets for part in (ast.walk(target) if in_tuples else [target])]
        names = [part for part in parts if isinstance(part, ast.Name)]
        yield from ((name.lineno, name.id) for name in names if re.fullmatch(r"_?[A-Z][A-Z0-9_]*", name.id))


def classes(tree):
    return [(node.lineno, node.name) for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]


def text_files(root, *names):
    """Sources and pages of a copy of the project, in files or below folders, without what was built."""
    below = [path for name in names for path in ((root / name).rglob("*") if (root / name).is_dir() else [root / name])]
    return [path for path in sorted(below) if path.suffix in {".py", ".rst", ".md"} and not BUILT & set(path.parts)]


def lines_with(pattern, root, files):
    """Lines in which a pattern is found, each behind its file and number."""
    return [
        f"{path.relative_to(root)}:{number}: {line.strip()}"
        for path in files
        for number, line in enumerate(path.read_text().splitlines(), start=1)
        if re.search(pattern, line)
    ]


def imported(tree):
    """Modules that a file imports; in place of ``from package import module``, the package."""
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=names):
                yield from (alias.name for alias in names)
            case ast.ImportFrom(module=module, level=level):
                yield "." * level + (module or "")


def packages_imported(package, within=()):
    """The public packages in a package, or in a folder of it, and those beside it that each of them imports."""
    folder = package.joinpath(*within)
    beside = {file.parent.name for file in folder.glob("*/__init__.py") if file.parent.name[0] != "_"}
    found = {one: set() for one in beside}
    for one in beside:
        for file in (folder / one).rglob("*.py"):
            modules = (module.split(".") for module in imported(tree_of(file)))
            inside = [parts[1:] for parts in modules if parts[: 1 + len(within)] == [package.name, *within]]
            found[one] |= {parts[len(within)] for parts in inside if len(parts) > len(within)} & beside - {one}
    return found


def below(room, imports):
    """What a package imports, directly or by what it imports."""
    return imports[room].union(*(below(one, imports) for one in imports[room]))


def built_on(imports):
    """Of what each package imports, what none of the others imports."""
    return {room: names - set().union(*(below(one, imports) for one in names)) for room, names in imports.items()}


def floors(imports):
    """Packages in rows from the ground up, each above all that it imports."""
    rows, placed = [], set()
    while placed != set(imports):
        rows.append(sorted(room for room in set(imports) - placed if imports[room] <= placed))
        assert rows[-1], f"packages import each other in a circle: {sorted(set(imports) - placed)}"
        placed.update(rows[-1])
    return rows


def private_imports(tree):
    """Private modules of the package, and private names of its modules, that a file imports, with their lines."""
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=names):
                modules = [alias.name for alias in names]
            case ast.ImportFrom(module=str(module), names=names):
                modules = [f"{module}.{alias.name}" for alias in names]
            case _:
                continue
        ours = [module for module in modules if module.split(".")[0] == "skthermo"]
        yield from ((node.lineno, module) for module in ours if re.search(r"\._[^_]", module))


def constructors_called_of(tree):
    """Class methods and functions that are called ``of``."""
    return [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and node.name == "of"]


def names_in_two_files(trees):
    """Classes and constants that more than one file defines, with their places."""
    defined = defaultdict(dict)
    for file, tree in trees.items():
        for line, name in [*constants(tree), *classes(tree)]:
            defined[name][file] = f"{file}:{line}"
    return {name: [*places.values()] for name, places in defined.items() if len(places) > 1}


def kinds_of_warnings(tree):
    """Kinds of warnings, each with its line and the category that the source gives it, which is None in the table of
    findings' texts."""
    for node in ast.walk(tree):
        match node:
            case ast.Call(func=ast.Name(id=name), args=[_, ast.Constant(value=kind)]) if name.endswith("Warning"):
                yield node.lineno, kind, name
            case ast.Assign(targets=[ast.Name(id="WARNINGS")], value=ast.Dict(keys=keys)):
                yield from ((key.lineno, key.value, None) for key in keys)


def hidden_state(tree):
    """Where a file keeps or looks for what no argument gives: pairs of line and what is used there."""
    found = set()
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name) | ast.Attribute(attr=name) | ast.alias(name=name) if name in HIDDEN:
                found.add((node.lineno, HIDDEN[name]))
            case ast.ImportFrom(module=module) if module in HIDDEN:
                found.add((node.lineno, HIDDEN[module]))
            case ast.Call(func=ast.Name(id="id")) | ast.Attribute(value=ast.Attribute(attr="ctypes"), attr="data"):
                found.add((node.lineno, "addresses of objects"))
            case (
                ast.Call(func=ast.Name(id="setattr" | "delattr"), args=[ast.Name(id=owner), *_])
                | ast.Call(
                    func=ast.Attribute(value=ast.Name(id="object"), attr="__setattr__"), args=[ast.Name(id=owner), *_]
                )
            ) if owner not in OWN:
                found.add((node.lineno, "attributes of other objects"))
            case (
                ast.Subscript(value=ast.Call(func=ast.Name(id="vars"), args=[ast.Name(id=owner)]), ctx=ast.Store())
                | ast.Attribute(
                    value=ast.Call(func=ast.Name(id="vars"), args=[ast.Name(id=owner)]),
                    attr="update" | "setdefault" | "pop",
                )
            ) if owner not in OWN:
                found.add((node.lineno, "attributes of other objects"))
    return sorted(found)
