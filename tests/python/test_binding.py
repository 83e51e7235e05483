"""The binding against the public headers: functions, members of structures, constants; versions of libraries."""

import ctypes as c
import os
import pathlib
import re
import shutil
import subprocess
import sys

import pytest

from pinwheel import _library as lib

TOP = pathlib.Path(__file__).resolve().parents[2]
HEADERS = ["core/pinwheel.h", "core/run.h", "core/files/pinwheel-files.h", "solvers/pinwheel-solvers.h", "solvers/pinwheel-analysis.h"]
STRUCTURES = [kind for name, kind in vars(lib).items() if name in lib._LAYOUT]


def parsed(folder):
    """Declarations of the headers in a folder, by name."""
    parser = pytest.importorskip("pycparser")
    hide = ["-D__attribute__(x)=", "-D__extension__=", "-D__restrict=", "-D__inline=", "-D__asm__(x)=", "-D__builtin_va_list=int",
            "-D_Float128=double", "-D_Noreturn="]
    text = "\n".join(f'#include "{folder / pathlib.Path(h).name}"' for h in HEADERS)
    done = subprocess.run([os.environ.get("CC", "cc").split()[-1], "-E", "-P", "-std=c11", "-U__GNUC__", *hide, f"-I{folder}", "-"],
                          input=text, capture_output=True, text=True, check=True)
    source = re.sub(r"#pragma.*|_Pragma *\([^)]*\)", "", done.stdout)
    tree = parser.CParser().parse(source)
    named = {node.name: node for node in tree.ext if getattr(node, "name", None)}
    return {**named, **collected(tree)}


def collected(tree):
    """Structures by "struct TAG", and the values of all constants of enumerations as "enumerators"."""
    from pycparser import c_ast
    found, stack = {"enumerators": {}}, [tree]
    while stack:
        node = stack.pop()
        if isinstance(node, c_ast.Struct) and node.name and node.decls:
            found[f"struct {node.name}"] = node
        if isinstance(node, c_ast.EnumeratorList):
            value = -1
            for item in node.enumerators:
                value = value + 1 if item.value is None else constant(item.value)
                found["enumerators"][item.name] = value
        stack += [child for _, child in node.children()]
    return found


def constant(node):
    from pycparser import c_ast
    return -int(node.expr.value) if isinstance(node, c_ast.UnaryOp) else int(node.value, 0) if isinstance(node, c_ast.Constant) else 0


def shape(node, types):
    """"pointer", "double", "int", "long", "size_t" or "void" of a declaration."""
    from pycparser import c_ast
    while isinstance(node, (c_ast.Decl, c_ast.Typename, c_ast.TypeDecl, c_ast.Typedef)):
        node = node.type
    if isinstance(node, (c_ast.PtrDecl, c_ast.ArrayDecl, c_ast.FuncDecl)):
        return "pointer"
    if isinstance(node, c_ast.Enum):
        return "int"
    name = " ".join(node.names) if isinstance(node, c_ast.IdentifierType) else "structure"
    return shape(types[name], types) if name in types and name != "size_t" else name


def shape_of(kind):
    names = {None: "void", c.c_int: "int", c.c_long: "long", c.c_double: "double", c.c_size_t: "size_t"}
    return names.get(kind, "pointer")


def differences(folder):
    """What the binding declares otherwise than the headers in a folder."""
    types, found = parsed(folder), []
    for name, function in lib.SIGNATURES.items():
        if name not in types:
            found.append(f"{name}: not declared")
            continue
        node = types[name].type
        arguments = [shape(p, types) for p in node.args.params]
        declared = [shape(node.type, types)] + ([] if arguments == ["void"] else arguments)
        bound = [shape_of(function.restype), *map(shape_of, function.argtypes)]
        if bound != declared:
            found.append(f"{name}: {declared} in the header, {bound} in the binding")
    for kind in STRUCTURES:
        found += [f"{kind.__name__}.{text}" for text in members(kind, types)]
    for name, value in vars(lib).items():
        if name.startswith("PW_") and types["enumerators"].get(name) != value:
            found.append(f"{name}: {types['enumerators'].get(name)} in the header, {value} in the binding")
    return found


def members(kind, types):
    """Members of a structure whose type differs."""
    for name, bound in kind._fields_:
        if name.startswith("_"):
            continue
        declared = member(types[kind.__name__], name.split("__"), types)
        expected = "pointer" if issubclass(bound, c.Array) else shape_of(bound)
        if declared != expected:
            yield f"{name}: {declared} in the header, {expected} in the binding"


def member(node, path, types):
    """The shape of a member, perhaps of a nested structure or union."""
    from pycparser import c_ast
    while not isinstance(node, (c_ast.Struct, c_ast.Union)):
        node = types[" ".join(node.names)] if isinstance(node, c_ast.IdentifierType) else node.type
    for decl in (node if node.decls else types[f"struct {node.name}"]).decls:
        found = member(decl.type, path, types) if decl.name is None else None
        if found or decl.name == path[0]:
            return found or (member(decl.type, path[1:], types) if path[1:] else shape(decl, types))
    return None


@pytest.fixture
def headers(tmp_path):
    for name in HEADERS:
        shutil.copy(TOP / name, tmp_path)
    return tmp_path


def test_the_binding_follows_the_headers(headers):
    assert differences(headers) == []
    domain = parsed(headers)["enumerators"]
    assert [domain[name] for name in lib.DOMAINS] == [*range(domain["PW_FRACTION"] + 1)]


@pytest.mark.parametrize("file, old, new, named", [
    ("pinwheel-solvers.h", "double pw_run_time (", "float pw_run_time (", "pw_run_time"),
    ("pinwheel-solvers.h", "long count, long steps, double *rows", "int count, long steps, double *rows", "pw_run_record"),
    ("pinwheel-files.h", "pw_file *pw_file_open (const char *model, pw_error *error);", "pw_file *pw_file_open (const char *model);", "pw_file_open"),
    ("run.h", "  double step; /*", "  long step; /*", "pw_settings.step"),
    ("pinwheel.h", "PW_INPUT = -2", "PW_INPUT = -5", "PW_INPUT"),
    ("pinwheel.h", "PW_CONSTANT, PW_HARMONIC, PW_FUNCTION", "PW_CONSTANT, PW_FUNCTION, PW_HARMONIC", "PW_FUNCTION"),
    ("pinwheel-solvers.h", "pw_run_record_width", "pw_run_width", "pw_run_record_width"),
])
def test_a_changed_header_is_noticed(headers, file, old, new, named):
    text = (headers / file).read_text()
    assert old in text
    (headers / file).write_text(text.replace(old, new))
    assert any(text.startswith(named) for text in differences(headers))


def test_layouts_are_checked():
    with pytest.raises(ImportError, match="pw_settings.step"):
        lib._structure("pw_settings", step=c.c_float)


def importing(folder):
    return subprocess.run([sys.executable, "-c", "import pinwheel"], capture_output=True, text=True, check=False,
                          env={**os.environ, "PINWHEEL_LIBRARY": str(folder)})


def test_missing_library_is_named():
    done = importing("/nowhere")
    assert done.returncode and "PINWHEEL_LIBRARY" in done.stderr


def test_library_may_be_in_the_working_directory(monkeypatch):
    monkeypatch.chdir(lib.library_path.parent)
    assert importing(".").returncode == 0


@pytest.mark.parametrize("source, text", [
    ('const char pw_version[] = "9.8.7";', "is Pinwheel 9.8.7, this package belongs to 0.1.0"),
    ("int nothing;", "is not a library of Pinwheel"),
])
def test_other_libraries_are_refused(tmp_path, source, text):
    (tmp_path / "other.c").write_text(source)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", tmp_path / "libpinwheel.so", tmp_path / "other.c"], check=True)
    done = importing(tmp_path)
    assert done.returncode == 1 and text in done.stderr


def test_versions_agree():
    header = (TOP / "core/pinwheel.h").read_text()
    assert f'PW_VERSION "{lib.VERSION}"' in header
    for file in ("pyproject.toml", "backend.py"):
        assert f'"{lib.VERSION}"' in (TOP / "core/python" / file).read_text(), file


def test_modules_import_each_other_at_their_top():
    for path in sorted(pathlib.Path(lib.__file__).parent.glob("*.py")):
        late = re.findall(r"^ +from \..*", path.read_text(encoding="utf-8"), re.M)
        assert not late, f"{path.name}: {late}: a cycle?"
