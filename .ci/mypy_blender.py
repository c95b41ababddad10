# SPDX-License-Identifier: GPL-3.0-or-later
"""Plugin for mypy: amend the stubs for Blender where they are wrong, or stricter than Blender is.

`blender_amendments.pyi` is read as a stub. The members of its classes replace those of the same name in the classes
of the stubs; others are added. The properties that the add-on registers get their types here.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path

from mypy.build import PRI_MED
from mypy.checker import TypeChecker
from mypy.errors import Errors
from mypy.nodes import (
    AssignmentStmt,
    ClassDef,
    Decorator,
    FuncDef,
    MypyFile,
    NameExpr,
    OverloadedFuncDef,
    Statement,
    TypeInfo,
)
from mypy.options import Options
from mypy.parse import parse
from mypy.plugin import AttributeContext, ClassDefContext, Plugin, ReportConfigContext
from mypy.types import Instance, Type

AMENDMENTS = Path(__file__).with_name("blender_amendments.pyi")

# Where the classes are that are not in `bpy.types`.
ELSEWHERE = {
    "Color": "mathutils",
    "Euler": "mathutils",
    "Matrix": "mathutils",
    "Vector": "mathutils",
    "_GenericUI": "_bpy_types",
}

# Properties that the add-on registers, and the classes that declare what is in them.
DECLARATIONS = "blender_addon.settings.typed"
REGISTERED = {"bpy.types.Object.umbra": "HoleSettings", "bpy.types.Scene.umbra": "SceneSettings"}


def _name(statement: Statement) -> str | None:
    """Return the name that a statement of a class defines, if any."""
    if isinstance(statement, FuncDef | Decorator | OverloadedFuncDef):
        return statement.name
    if isinstance(statement, AssignmentStmt) and isinstance(statement.lvalues[0], NameExpr):
        return statement.lvalues[0].name
    return None


class BlenderPlugin(Plugin):
    """The hooks that mypy calls while it reads the stubs and checks the add-on."""

    def __init__(self, options: Options) -> None:
        super().__init__(options)
        self._classes = {each.name: each for each in self._parsed()}

    def _parsed(self) -> list[ClassDef]:
        text = AMENDMENTS.read_text(encoding="utf-8")
        tree = parse(text, str(AMENDMENTS), None, Errors(self.options), self.options, eager=True)
        return [each for each in tree.defs if isinstance(each, ClassDef)]

    def report_config_data(self, ctx: ReportConfigContext) -> str:
        """Let mypy's cache depend on the amendments."""
        return hashlib.sha256(AMENDMENTS.read_bytes()).hexdigest()

    def get_customize_class_mro_hook(self, fullname: str) -> Callable[[ClassDefContext], None] | None:
        """Amend a class before its body is analyzed."""
        module, _, name = fullname.rpartition(".")
        return self._amend if name in self._classes and module == ELSEWHERE.get(name, "bpy.types") else None

    def _amend(self, context: ClassDefContext) -> None:
        members, body = self._classes[context.cls.name].defs.body, context.cls.defs.body
        if body[-1] is members[-1]:  # done: a class is analyzed again until all names in it are known
            return
        names = {_name(each) for each in members}
        body[:] = [each for each in body if _name(each) not in names] + members

    def get_additional_deps(self, file: MypyFile) -> list[tuple[int, str, int]]:
        """Let the add-on's modules depend on the declarations, which they use without importing them."""
        return [(PRI_MED, DECLARATIONS, -1)] if file.fullname.startswith("blender_addon.") else []

    def get_attribute_hook(self, fullname: str) -> Callable[[AttributeContext], Type] | None:
        """Give the add-on's properties their types."""
        if fullname not in REGISTERED:
            return None

        def registered(context: AttributeContext) -> Type:
            assert isinstance(context.api, TypeChecker)
            if DECLARATIONS not in context.api.modules:  # only other programs than the add-on are checked
                return context.default_attr_type
            declared = context.api.modules[DECLARATIONS].names[REGISTERED[fullname]].node
            assert isinstance(declared, TypeInfo)
            return Instance(declared, [])

        return registered


def plugin(version: str) -> type[Plugin]:
    """Return the plugin, as mypy asks for it."""
    return BlenderPlugin
