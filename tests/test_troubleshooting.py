"""The page of warnings names every warning that the source can give, and none that it cannot."""

import ast
import re
from collections import defaultdict
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "guide" / "troubleshooting.rst"
ANY = "…"
"""What a message and the page have in place of numbers and names."""

ERRORS = "The most common errors"
"""Title of the section that explains errors."""

REPORTS = [
    "_sentences",
    "_doubts",
    "summary",
    "likely_causes",
    "answer",
    "limits",
    "sentences",
    "waits_text",
    "false_alarms_text",
]
"""Functions whose sentences tell what is doubtful."""


STATES = {"monitoring/_monitor.py", "fleet/_fleet.py"}
"""Files whose sentences tell how things stand, not what is doubtful."""


class Source:
    """Texts that a package can give, read from its syntax trees.

    Parameters
    ----------
    files : mapping of str to str
        Source by file name.
    """

    def __init__(self, files):
        self.trees = {name: ast.parse(text) for name, text in files.items()}
        self.functions = defaultdict(list)
        self.constants = defaultdict(list)
        self.entered = []
        for file, tree in self.trees.items():
            for node in tree.body:
                match node:
                    case ast.Assign(targets=[ast.Name(id=name)], value=ast.Dict() as value):
                        self.constants[name].append(value)
            for node in ast.walk(tree):
                if isinstance(node, ast.FunctionDef) and file not in STATES:
                    self.functions[node.name].append(node)

    def warnings(self):
        """Texts of all warnings by file and line; None where the source does not show the text."""
        found = {}
        for name, tree in self.trees.items():
            for function in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
                for call in (node for node in ast.walk(function) if isinstance(node, ast.Call)):
                    if called(call) in {"warn_user", "warn_each", "warn"} and name != "_estimators/warnings.py":
                        texts = self.texts(call.args[0], function)
                        found[f"{name}:{call.lineno}"] = set(filter(is_telling, texts)) or None
        return found

    def errors(self, within=None):
        """Texts of all errors, or of those that one function raises."""
        everywhere = [function for group in self.functions.values() for function in group]
        raisers = everywhere if within is None else self.functions.get(within, [])
        raised = [(f, node.exc) for f in raisers for node in ast.walk(f) if isinstance(node, ast.Raise)]
        calls = [(f, error) for f, error in raised if isinstance(error, ast.Call) and error.args]
        return {text for function, error in calls for text in self.texts(error.args[0], function)}

    def given(self, name):
        """Texts that the functions of a name return or yield."""
        texts = set()
        if name in self.entered:  # functions of one name that call each other
            return texts
        self.entered.append(name)
        for function in self.functions[name]:
            for node in ast.walk(function):
                if isinstance(node, ast.Return | ast.Yield | ast.YieldFrom):
                    texts |= self.texts(node.value, function)
        self.entered.pop()
        return texts

    def texts(self, node, function):
        """What an expression can say, with "…" for its values."""
        match node:
            case ast.Constant(value=str(text)):
                return {text}
            case ast.JoinedStr(values=parts):
                return {shortened("".join(p.value if isinstance(p, ast.Constant) else ANY for p in parts))}
            case ast.BinOp(left=left, right=right):
                ends = self.texts(right, function)
                return {shortened(start + end) for start in self.texts(left, function) for end in ends}
            case ast.IfExp(body=body, orelse=orelse):
                return self.texts(body, function) | self.texts(orelse, function)
            case ast.Tuple(elts=[*_, text]) | ast.Starred(value=text) | ast.ListComp(elt=text):
                return self.texts(text, function)
            case ast.List(elts=items):
                return {text for item in items for text in self.texts(item, function)}
            case ast.Subscript(value=value):
                return self.texts(value, function)
            case ast.Name(id=name):
                return {text for value in assigned(name, function) for text in self.texts(value, function)} or {ANY}
            case ast.Call(func=ast.Attribute(attr="format", value=ast.Subscript(value=ast.Name(id=name)))):
                templates = [item for value in self.constants[name] for item in value.values]
                return {re.sub(r"{.*?}", ANY, text) for item in templates for text in self.texts(item, function)}
            case ast.Call(func=ast.Name(id="str"), args=[ast.Name(id=name)]) if caught(name, function):
                return {text for checks in caught(name, function) for text in self.errors(checks)}
            case ast.Call(func=ast.Name(id=name), args=[text, _]) if name.endswith("Warning"):
                return self.texts(text, function)
            case ast.Call(func=ast.Attribute(attr="join"), args=[items]):
                return self.texts(items, function)
            case ast.Call() if called(node) in self.functions:
                return self.given(called(node))
        return {ANY}


def called(call):
    """Last name of what a call calls."""
    return getattr(call.func, "attr", getattr(call.func, "id", None))


def assigned(name, function):
    """Expressions that a function gives to a name, one by one or as items."""
    for node in ast.walk(function):
        match node:
            case ast.Assign(targets=[ast.Name(id=target)]) if target == name:
                yield node.value
            case ast.AugAssign(target=ast.Name(id=target)) if target == name:
                yield node.value
            case ast.For(target=ast.Name(id=target)) if target == name:
                yield node.iter
            case ast.Call(func=ast.Attribute(value=ast.Name(id=target), attr="append")) if target == name:
                yield from node.args


def caught(name, function):
    """Functions whose errors a function catches under a name."""
    for node in ast.walk(function):
        if isinstance(node, ast.Try) and name in [handler.name for handler in node.handlers]:
            return [called(call) for line in node.body for call in ast.walk(line) if isinstance(call, ast.Call)]
    return []


def shortened(text):
    return re.sub(f"{ANY}(\\s*{ANY})+", ANY, text)


@pytest.fixture(scope="module")
def source():
    package = ROOT / "skthermo"
    return Source({p.relative_to(package).as_posix(): p.read_text() for p in sorted(package.rglob("*.py"))})


@pytest.fixture(scope="module")
def warnings_of_the_package(source):
    return {text for known in source.warnings().values() for text in known or ()}


@pytest.fixture(scope="module")
def sentences_of_reports(source):
    return {text for name in REPORTS for text in source.given(name) if is_telling(text)}


@pytest.fixture(scope="module")
def terms():
    """Messages that the page explains, by section."""
    sections = re.split(r"^(.+)\n-+\n", PAGE.read_text(), flags=re.MULTILINE)
    titles, bodies = sections[1::2], sections[2::2]
    return {t: re.findall(r"^``(.+)``$", body, flags=re.MULTILINE) for t, body in zip(titles, bodies, strict=True)}


def is_telling(text):
    return re.search(r"\w{3}", text) is not None


def explains(term, text):
    """Whether a term is the beginning of a message, or holds the longest part of it that never changes."""
    return text.startswith(term) or (term in text and max(text.split(ANY), key=len).strip(" ;") in term)


def test_the_page_explains_every_warning(warnings_of_the_package, sentences_of_reports, terms):
    explained = [term for title, found in terms.items() if title != ERRORS for term in found]
    given = warnings_of_the_package | sentences_of_reports
    missing = [text for text in sorted(given) if not any(explains(term, text) for term in explained)]
    assert missing == []


def test_the_page_explains_no_message_that_does_not_exist(source, warnings_of_the_package, sentences_of_reports, terms):
    for title, found in terms.items():
        texts = source.errors() if title == ERRORS else warnings_of_the_package | sentences_of_reports
        invented = [term for term in found if not any(explains(term, text) for text in texts)]
        assert not invented, title


def test_terms_are_long_enough_to_be_found(terms):
    assert sum(map(len, terms.values())) > 80
    for found in terms.values():
        assert all(len(re.findall(r"\w{2,}", term)) >= 2 for term in found)
        assert len(found) == len(set(found))


def test_the_text_of_every_warning_is_read_from_the_source(source):
    assert not [site for site, texts in source.warnings().items() if not texts]


FORMS = """
def direct(n):
    warn_user(f"{n} rows are wet", RecordsWarning, "kind")

def named(n):
    message = f"{n} rows are " + ("cold" if n else "hot")
    warnings.warn(message, stacklevel=2)

def gathered(n):
    problems = []
    problems.append(f"row {n} is dry")
    warn_user("; ".join(problems[:3]), RecordsWarning, "kind")

def text_of(n):
    yield RecordsWarning(f"row {n} is windy", "kind")

def several(n):
    warn_each(text_of(n))

def check(n):
    raise ValueError(f"row {n} is frozen")

def caught(n):
    try:
        check(n)
    except ValueError as error:
        warn_user(str(error), RecordsWarning, "kind")

FORMS = {0: "{} is calm.", 1: "{} has {} of wind."}

def formatted(n):
    warn_user(FORMS[n].format(n, n), RecordsWarning, "kind")

def hidden(n):
    warn_user(n, RecordsWarning, "kind")
"""


def test_a_new_warning_is_found_whatever_form_it_has():
    found = Source({"weather.py": FORMS}).warnings()
    assert list(found.values()) == [
        {"… rows are wet"},
        {"… rows are cold", "… rows are hot"},
        {"row … is dry"},
        {"row … is windy"},
        {"row … is frozen"},
        {"… is calm.", "… has … of wind."},
        None,
    ]
    assert not explains("row … is dry", "… rows are wet")
