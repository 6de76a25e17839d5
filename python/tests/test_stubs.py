"""The type stubs say what the module has: names, parameters, defaults."""

import ast
import inspect
import unittest
from pathlib import Path

import tumble

STUBS = Path(__file__).resolve().parent.parent / "tumble.pyi"


def of_stub(function, is_method):
    """Name, kind and default of each parameter."""
    given, kinds = function.args, inspect.Parameter
    plain = given.args[1:] if is_method else given.args
    missing = [inspect.Parameter.empty] * (len(plain) - len(given.defaults))
    defaults = missing + [ast.literal_eval(default) for default in given.defaults]
    found = [(a.arg, kinds.POSITIONAL_OR_KEYWORD, default) for a, default in zip(plain, defaults)]
    for argument, default in zip(given.kwonlyargs, given.kw_defaults):
        value = inspect.Parameter.empty if default is None else ast.literal_eval(default)
        found.append((argument.arg, kinds.KEYWORD_ONLY, value))
    return found


def of_module(function, is_method):
    parameters = list(inspect.signature(function).parameters.values())
    return [(p.name, p.kind, p.default) for p in (parameters[1:] if is_method else parameters)]


class Stubs(unittest.TestCase):
    def test_they_are_the_module(self):
        stub = ast.parse(STUBS.read_text(encoding="utf-8"))
        public = {}
        for item in stub.body:
            if isinstance(item, (ast.FunctionDef, ast.ClassDef)) and not item.name.startswith("_"):
                public[item.name] = item
        module = {name for name in dir(tumble) if not name.startswith("_") and name != "tumble"}
        self.assertEqual(set(public), module)
        for name, item in public.items():
            with self.subTest(name=name):
                real = getattr(tumble, name)
                if isinstance(item, ast.FunctionDef):
                    self.assertEqual(of_stub(item, False), of_module(real, False))
                elif not issubclass(real, Exception):
                    self.members(item, real)

    def members(self, stub, real):
        properties, methods = set(), {}
        for item in stub.body:
            if isinstance(item, ast.FunctionDef):
                decorated = [d.id for d in item.decorator_list if isinstance(d, ast.Name)]
                properties.add(item.name) if "property" in decorated else methods.setdefault(item.name, item)
        names = {name for name in vars(real) if not name.startswith("_")}
        self.assertEqual(properties | set(methods) - {"__init__"}, names)
        for name in properties:
            self.assertTrue(inspect.isgetsetdescriptor(vars(real)[name]), name)
        for name, item in methods.items():
            if name == "__init__":
                self.assertEqual(of_stub(item, True), of_module(real, False))
            else:
                self.assertEqual(of_stub(item, True), of_module(getattr(real, name), True), name)

    def test_every_function_says_what_it_does(self):
        for name in (name for name in dir(tumble) if not name.startswith("_")):
            self.assertTrue(getattr(tumble, name).__doc__, name)


if __name__ == "__main__":
    unittest.main()
