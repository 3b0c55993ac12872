"""The typed stubs name what the extension module has, with the same parameters."""

import ast
import inspect
import pathlib

import pytest

import softras
from softras import _softras

STUB = ast.parse((pathlib.Path(softras.__file__).parent / "_softras.pyi").read_text(encoding="utf-8"))


def of(kind):
    return [node for node in STUB.body if isinstance(node, kind)]


def parameters(node):
    """The parameters of a stub's function and whether each has a default."""
    given = node.args
    places = given.posonlyargs + given.args
    defaults = [False] * (len(places) - len(given.defaults)) + [True] * len(given.defaults)
    named = [(one.arg, default is not None) for one, default in zip(given.kwonlyargs, given.kw_defaults)]
    return [(one.arg, default) for one, default in zip(places, defaults) if one.arg not in ("self", "cls")] + named


def agrees(node, function):
    """Whether a function has the stub's parameters; of those that it takes as **names the stub may tell more."""
    found = inspect.signature(function).parameters.values()
    kinds = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    named = [one for one in found if one.kind not in kinds and one.name not in ("self", "cls")]
    own, stub = [(one.name, one.default is not inspect.Parameter.empty) for one in named], parameters(node)
    return own == stub or (len(named) < len(found) and set(own) <= set(stub))


def public(names):
    return {name for name in names if not name.startswith("_")}


def test_the_module_has_the_stubs_names():
    assert public(node.name for node in STUB.body if hasattr(node, "name")) == public(dir(_softras))


@pytest.mark.parametrize("node", of(ast.FunctionDef), ids=lambda node: node.name)
def test_a_function_is_as_in_the_stub(node):
    assert agrees(node, getattr(_softras, node.name))


@pytest.mark.parametrize("node", of(ast.ClassDef), ids=lambda node: node.name)
def test_a_class_is_as_in_the_stub(node):
    kind = getattr(_softras, node.name)
    methods = [one for one in node.body if isinstance(one, ast.FunctionDef)]
    assert public(one.name for one in methods) == public(dir(kind))
    for method in methods:
        found = inspect.getattr_static(kind, method.name)
        if any(isinstance(one, ast.Name) and one.id == "property" for one in method.decorator_list):
            assert inspect.isgetsetdescriptor(found)
        else:
            assert agrees(method, kind if method.name == "__new__" else getattr(kind, method.name)), method.name
