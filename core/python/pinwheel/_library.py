"""The C library through ctypes: functions, structures, errors.

Structures take their sizes and offsets from the library itself (``pw_members``), so they always match the one loaded.
"""

from __future__ import annotations

import ctypes as c
import ctypes.util
import os
import pathlib

OK, RETRY, STOPPED, RESOURCE, INPUT, INITIAL, METHOD = 0, 1, 2, -1, -2, -3, -4


class Error(Exception):
    """A failure reported by Pinwheel; the message is the library's."""


class InputError(Error, ValueError):
    """A wrong description, name, option or value."""


class InitialError(Error):
    """No initial state satisfies the constraints."""


class MethodError(Error):
    """An integration method failed during a run, or cannot be used for the model."""


class ResourceError(Error, OSError):
    """Out of memory, or a file cannot be read or written."""


_EXCEPTIONS = {RESOURCE: ResourceError, INPUT: InputError, INITIAL: InitialError, METHOD: MethodError}


# ---- Loading ----

def _folders():
    """Where the libraries may be: in the package (wheels), in a build of the source tree, in the package's prefix."""
    here = pathlib.Path(__file__).resolve().parent
    yield here / "lib"
    for parent in here.parents:
        yield parent / "build"
        yield parent / "lib"


def _load(name):
    file = f"lib{name}.so"
    named = os.environ.get("PINWHEEL_LIBRARY")
    folders = [pathlib.Path(named)] if named else list(_folders())
    for folder in folders:
        for path in sorted(folder.glob(file + "*")):
            return c.CDLL(str(path), mode=c.RTLD_GLOBAL), path
    system = None if named else ctypes.util.find_library(name)
    if system is None:
        raise ImportError(f"{file} was not found in {', '.join(map(str, folders[:2]))} ...: build Pinwheel with `make`, "
                          "install it, or name the folder of the library in PINWHEEL_LIBRARY")
    return c.CDLL(system, mode=c.RTLD_GLOBAL), pathlib.Path(system)


core, library_path = _load("pinwheel")
files, _ = _load("pinwheel-files")


def program() -> str:
    """The path of the program ``pinwheel`` that belongs to the library."""
    for path in (os.environ.get("PINWHEEL"), library_path.parent / "pinwheel", library_path.parent.parent / "bin/pinwheel"):
        if path and os.path.isfile(path) and os.access(path, os.X_OK):
            return str(path)
    return "pinwheel"


# ---- Structures ----

class _Member(c.Structure):
    _fields_ = [("name", c.c_char_p), ("offset", c.c_size_t), ("size", c.c_size_t)]


def _members():
    table, found = c.cast(core.pw_members, c.POINTER(_Member)), {}
    i = 0
    while table[i].name:
        found[table[i].name.decode()] = (table[i].offset, table[i].size)
        i += 1
    return found


_LAYOUT = _members()


def _structure(name, /, **types):
    """A ctypes structure with these members at the offsets of the library; the bytes between them have no name."""
    end, fields = 0, []
    for member, kind in sorted(types.items(), key=lambda item: _LAYOUT[f"{name}.{item[0].replace('__', '.')}"]):
        offset, size = _LAYOUT[f"{name}.{member.replace('__', '.')}"]
        if size != c.sizeof(kind):
            raise ImportError(f"{name}.{member}: the library has {size} bytes, this package {c.sizeof(kind)}")
        if offset > end:
            fields.append((f"_{offset}", c.c_char * (offset - end)))
        fields.append((member, kind))
        end = offset + size
    size = _LAYOUT[name][1]
    if size > end:
        fields.append(("_end", c.c_char * (size - end)))
    made = type(name, (c.Structure,), {"_fields_": fields, "_pack_": 1})
    assert c.sizeof(made) == size
    return made


_double_p = c.POINTER(c.c_double)
pw_error = _structure("pw_error", status=c.c_int, text=c.c_char * 500)
pw_initial_value = _structure("pw_initial_value", state=c.c_int, value=c.c_double)
pw_settings = _structure(
    "pw_settings", t=c.c_double, span=c.c_double, step=c.c_double, rtol=c.c_double, atol=c.c_double, ledger=c.c_int,
    max_steps=c.c_long, initial=c.c_void_p, initials=c.c_int)
pw_statistics = _structure(
    "pw_statistics", steps=c.c_long, rejected=c.c_long, rhs=c.c_long, jacobians=c.c_long, factorisations=c.c_long,
    position=c.c_double, velocity=c.c_double, g=c.c_double, jv=c.c_double)
pw_parameter = _structure("pw_parameter", name=c.c_char_p, value=c.c_double, unit=c.c_char_p, about=c.c_char_p)
pw_plugin_table = _structure(
    "pw_plugin_table", about=c.c_char_p, parameters=c.c_void_p, run__t_end=c.c_double, run__step=c.c_double,
    run__rtol=c.c_double, run__method=c.c_char_p)
pw_signal = _structure(
    "pw_signal", type=c.c_int, function__eval=c.c_void_p, function__context=c.c_void_p, function__reads=c.c_void_p)
pw_linear = _structure(
    "pw_linear", positions=c.c_int, velocities=c.c_int, unknowns=c.c_int, A=_double_p, re=_double_p, im=_double_p,
    steady=c.c_int, twist=c.c_double * 3, B=_double_p, basis=_double_p)
eval_function = c.CFUNCTYPE(c.c_int, c.c_void_p, c.c_double, _double_p, _double_p, _double_p)
PW_FUNCTION = 2


# ---- Functions ----

def _declare(library, result, *names_and_arguments):
    for name, *arguments in names_and_arguments:
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments


_p, _i, _d, _s, _e, _z = c.c_void_p, c.c_int, c.c_double, c.c_char_p, c.POINTER(pw_error), c.c_size_t
_declare(files, _p, ("pw_file_open", _s, _e), ("pw_file_model", _p, _e))
_declare(files, _s, ("pw_file_name", _p), ("pw_file_path", _p))
_declare(files, c.POINTER(pw_plugin_table), ("pw_file_table", _p))
_declare(files, None, ("pw_file_close", _p))
_declare(files, _i, ("pw_file_list", c.CFUNCTYPE(_i, _p, _s, _s), _p, _e))
_declare(core, None, ("pw_model_free", _p), ("pw_system_free", _p), ("pw_run_close", _p), ("pw_linear_free", c.POINTER(pw_linear)))
_declare(core, _i, ("pw_model_set", _p, _s, _d, _e), ("pw_model_build", _p, _e), ("pw_model_set_initial", _p, _s, _d, _e),
         ("pw_model_set_signal", _p, _s, _s, c.POINTER(pw_signal), _e))
_declare(core, _d, ("pw_model_parameter", _p, _p))
_declare(core, _p, ("pw_system_compile", _p, _e), ("pw_run_open", _p, _s, c.POINTER(pw_settings), _e))
_declare(core, _i, ("pw_system_coordinates", _p), ("pw_system_rows", _p), ("pw_system_bodies", _p), ("pw_system_signals", _p),
         ("pw_system_ledger_entries", _p), ("pw_system_find_state", _p, _s, _e))
_declare(core, _s, ("pw_system_state_name", _p, _i, _s, _z), ("pw_system_reaction_name", _p, _i, _s, _z),
         ("pw_system_ledger_name", _p, _i, _s, _z), ("pw_system_signal_name", _p, _i, _s, _z),
         ("pw_system_state_unit", _p, _i), ("pw_system_reaction_unit", _p, _i), ("pw_system_signal_unit", _p, _i))
_declare(core, _i, ("pw_run_advance_to", _p, _d, _d, _e), ("pw_run_restart", _p, _p, _p, _e),
         ("pw_run_record_width", _p), ("pw_run_linear_modes", _p, _i, c.POINTER(pw_linear), _e),
         ("pw_run_record", _p, _d, _p, c.c_long, c.c_long, _p, c.POINTER(c.c_long), _e))
_declare(core, _d, ("pw_run_time", _p))
_declare(core, c.POINTER(pw_statistics), ("pw_run_statistics", _p))


def check(error: pw_error):
    """Raises the exception of a library error, if there is one."""
    if error.status < 0:
        raise _EXCEPTIONS.get(error.status, Error)(error.text.decode(errors="replace"))


def text(value) -> str:
    return value.decode(errors="replace") if value else ""


def name_of(function, *arguments) -> str:
    buffer = c.create_string_buffer(400)
    function(*arguments, buffer, 400)
    return buffer.value.decode()
