"""The C library through ctypes: functions, structures, errors.

Structures take their sizes and offsets from the library itself (``pw_members``), so they always match the one loaded;
tests compare functions, members and constants with the public headers.
"""

from __future__ import annotations

import _signal as signal  # what the module signal wraps in Python, without its conversions: it is used at every call
import contextlib
import ctypes as c
import ctypes.util
import functools
import operator
import os
import pathlib
import threading

import numpy as np

VERSION = "0.1.0"
PW_OK, PW_RETRY, PW_STOPPED, PW_RESOURCE, PW_INPUT, PW_INITIAL, PW_METHOD = 0, 1, 2, -1, -2, -3, -4
PW_HARMONIC, PW_FUNCTION, PW_STEADY, PW_SPECIALISE_STEPS, PW_RECORD_STATES = 1, 2, 0, 1000000, 9
PW_FORCE, PW_HOLONOMIC, PW_NONHOLONOMIC = range(3)
PW_NUMBER, PW_POINT, PW_VECTOR, PW_BODY, PW_SIGNAL, PW_CHOICE, PW_TEXT, PW_TRACK = range(8)
DOMAINS = {"PW_REAL": "", "PW_NONNEGATIVE": ">= 0", "PW_POSITIVE": "> 0", "PW_COUNT": "1, 2, 3, ...",
           "PW_FRACTION": "from 0 to 1"}  # in the order of pw_domain


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


_EXCEPTIONS = {PW_RESOURCE: ResourceError, PW_INPUT: InputError, PW_INITIAL: InitialError, PW_METHOD: MethodError}


# ---- Loading ----

def _folders():
    """Where the libraries may be: in the package (wheels), in a build of the source tree, in an installed prefix."""
    here = pathlib.Path(__file__).resolve().parent
    yield here / "lib"
    for parent in here.parents:
        yield parent / "build"
        yield parent / "lib"


_given_folder = os.environ.get("PINWHEEL_LIBRARY")


def _load(name, folders):
    """A library and its path: from the first of these folders that has it, else where the system finds it."""
    file = f"lib{name}.so"
    for folder in folders:
        for path in sorted(folder.glob(file + "*")):
            return c.CDLL(str(path), mode=c.RTLD_GLOBAL), path
    system = None if _given_folder else ctypes.util.find_library(name)
    if system is None:
        raise ImportError(f"{file} was not found in {', '.join(map(str, folders[:2]))} ...: build Pinwheel with `make`, "
                          "install it, or name the folder of the library in PINWHEEL_LIBRARY")
    return c.CDLL(system, mode=c.RTLD_GLOBAL), pathlib.Path(system)


def _check_version(library, path):
    """A library of another version may have other functions and structures."""
    try:
        found = c.c_char.in_dll(library, "pw_version")
    except ValueError:
        raise ImportError(f"{path} is not a library of Pinwheel {VERSION}, to which this package belongs") from None
    found = c.string_at(c.addressof(found)).decode()
    if found != VERSION:
        raise ImportError(f"{path} is Pinwheel {found}, this package belongs to {VERSION}: install both from one source, "
                          "or name the folder of the other library in PINWHEEL_LIBRARY")


core, library_path = _load("pinwheel", [pathlib.Path(_given_folder).absolute()] if _given_folder else list(_folders()))
_check_version(core, library_path)
files, _ = _load("pinwheel-files", [library_path.parent] if library_path.parent.name else [])


def program() -> str:
    """The path of the program ``pinwheel`` of the same installation as the library."""
    for path in (os.environ.get("PINWHEEL"), library_path.parent / "pinwheel", library_path.parent.parent / "bin/pinwheel"):
        if path and os.path.isfile(path) and os.access(path, os.X_OK):
            return str(path)
    return "pinwheel"


# ---- Structures ----

class _Member(c.Structure):
    _fields_ = [("name", c.c_char_p), ("offset", c.c_size_t), ("size", c.c_size_t)]


def _members():
    """Offset and size of each "STRUCTURE.MEMBER", and of each structure, from the library's table."""
    table, found = c.cast(core.pw_members, c.POINTER(_Member)), {}
    i = 0
    while table[i].name:
        found[table[i].name.decode()] = (table[i].offset, table[i].size)
        i += 1
    return found


_LAYOUT = _members()


def _structure(name, /, **types):
    """A ctypes structure with these members at the offsets of the library, and unnamed bytes between them.

    "__" in the name of a member stands for "." in C.
    """
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


def listed(structure, address):
    """The structures of an array in C that ends with a NULL name."""
    while address and (entry := structure.from_address(address)).name:
        yield entry
        address += c.sizeof(structure)


_double_p = c.POINTER(c.c_double)
pw_error = _structure("pw_error", status=c.c_int, text=c.c_char * 500)
pw_initial_value = _structure("pw_initial_value", state=c.c_int, value=c.c_double)
pw_settings = _structure(
    "pw_settings", t=c.c_double, span=c.c_double, step=c.c_double, rtol=c.c_double, atol=c.c_double, ledger=c.c_int,
    stop=c.c_void_p, stop_context=c.c_void_p, max_steps=c.c_long, initial=c.c_void_p, initials=c.c_int, specialised=c.c_void_p)
pw_statistics = _structure(
    "pw_statistics", steps=c.c_long, rejected=c.c_long, rhs=c.c_long, jacobians=c.c_long, factorisations=c.c_long,
    restarts=c.c_long, specialised=c.c_long, conditions=c.c_long, unresolved=c.c_long, position=c.c_double, velocity=c.c_double, g=c.c_double, jv=c.c_double)
pw_event = _structure("pw_event", t=c.c_double, impulse=c.c_double, row=c.c_int, to=c.c_int, impact=c.c_int, **{"from": c.c_int})
pw_crossing = _structure("pw_crossing", value=c.c_void_p, context=c.c_void_p)
pw_initial_report = _structure(
    "pw_initial_report", q_given=_double_p, v_given=_double_p, q=_double_p, v=_double_p, moved=c.c_int,
    released=c.c_int)
pw_parameter = _structure("pw_parameter", name=c.c_char_p, value=c.c_double, unit=c.c_char_p, about=c.c_char_p)
pw_field = _structure(
    "pw_field", name=c.c_char_p, type=c.c_int, count=c.c_int, unit=c.c_char_p, required=c.c_int, domain=c.c_int,
    choices=c.POINTER(c.c_char_p), about=c.c_char_p)
pw_quantity = _structure("pw_quantity", name=c.c_char_p, unit=c.c_char_p, about=c.c_char_p)
pw_kind = _structure(
    "pw_kind", name=c.c_char_p, about=c.c_char_p, fields=c.c_void_p, rows=c.c_int, reaction=c.c_void_p, level=c.c_int,
    force_u=c.c_void_p)
pw_element = _structure("pw_element", kind=c.POINTER(pw_kind), definition=c.POINTER(c.c_char_p))
pw_plugin_table = _structure(
    "pw_plugin_table", about=c.c_char_p, parameters=c.c_void_p, run__t_end=c.c_double, run__step=c.c_double,
    run__rtol=c.c_double, run__method=c.c_char_p)
pw_signal = _structure(
    "pw_signal", type=c.c_int, function__eval=c.c_void_p, function__context=c.c_void_p, function__reads=c.c_void_p)
pw_constant = _structure("pw_signal", type=c.c_int, harmonic__offset=c.c_double)  # other members of its union
pw_archive = _structure("pw_archive", at=c.c_void_p, used=c.c_size_t, size=c.c_size_t, loading=c.c_int)
pw_ensemble = _structure(
    "pw_ensemble", run=c.c_void_p, count=c.c_int, threads=c.c_int, inputs=c.c_int, columns=c.c_int, signal=c.c_void_p,
    input=c.c_void_p, column=c.c_void_p, observed=c.c_void_p, status=c.c_void_p, error=c.c_void_p, lanes=c.c_void_p)
pw_linear = _structure(
    "pw_linear", positions=c.c_int, velocities=c.c_int, unknowns=c.c_int, A=_double_p, re=_double_p, im=_double_p,
    steady=c.c_int, twist=c.c_double * 3, B=_double_p, basis=_double_p)
eval_function = c.CFUNCTYPE(c.c_int, c.c_void_p, c.c_double, _double_p, _double_p, _double_p)


# ---- Functions ----

SIGNATURES = {}  # functions by name


def _declare(library, result, *names_and_arguments):
    for name, *arguments in names_and_arguments:
        function = SIGNATURES[name] = getattr(library, name)
        function.restype, function.argtypes = result, arguments


# Types of arguments and results: pointer, int, double, text, error, size.
_p, _i, _d, _s, _e, _z = c.c_void_p, c.c_int, c.c_double, c.c_char_p, c.POINTER(pw_error), c.c_size_t
_declare(files, _p, ("pw_file_open", _s, _e), ("pw_file_model", _p, _e))
_declare(files, _s, ("pw_file_name", _p))
_declare(files, c.POINTER(pw_plugin_table), ("pw_file_table", _p))
_declare(files, None, ("pw_file_close", _p))
_declare(files, _s, ("pw_number_hint", _s, _s, _z))
_declare(files, _i, ("pw_read_expression", _s, _double_p), ("pw_file_list", c.CFUNCTYPE(_i, _p, _s, _s), _p, _e))
_declare(core, None, ("pw_model_free", _p), ("pw_system_free", _p), ("pw_run_close", _p), ("pw_linear_free", c.POINTER(pw_linear)))
_declare(core, _i, ("pw_model_set", _p, _s, _d, _e), ("pw_model_build", _p, _e), ("pw_model_set_initial", _p, _s, _d, _e),
         ("pw_model_set_signal", _p, _s, _s, c.POINTER(pw_signal), _e))
_declare(core, _d, ("pw_method_steps", _s, c.POINTER(pw_settings), _d, _d))
_declare(core, _p, ("pw_system_source", _p, _p, _e), ("pw_run_source", _p, _e))
_declare(files, _p, ("pw_scene_code_open", _p, _p, _e), ("pw_scene_code_table", _p))
_declare(files, None, ("pw_scene_code_close", _p))
_declare(core, _p, ("pw_system_compile", _p, _e), ("pw_run_open", _p, _s, c.POINTER(pw_settings), _e))
_declare(core, _i, ("pw_system_coordinates", _p), ("pw_system_rows", _p), ("pw_system_bodies", _p), ("pw_system_signals", _p),
         ("pw_system_find_state", _p, _s, _e), ("pw_system_state_hidden", _p, _i))
_declare(core, _s, ("pw_system_state_name", _p, _i, _s, _z), ("pw_system_signal_name", _p, _i, _s, _z),
         ("pw_system_record_name", _p, _i, _s, _z), ("pw_system_record_unit", _p, _i),
         ("pw_system_table_notice", _p, _i, _d, _s, _z),
         ("pw_system_state_unit", _p, _i), ("pw_system_signal_unit", _p, _i))
_declare(core, _i, ("pw_run_record_width", _p), ("pw_system_record_width", _p, _i), ("pw_system_record_same", _p, _p, _i),
         ("pw_run_linear_modes", _p, _i, c.POINTER(pw_linear), _e),
         ("pw_run_record", _p, _d, _p, c.c_long, c.c_long, _p, c.POINTER(c.c_long), _e))
_declare(core, _p, ("pw_repetition_open", _p, _s, c.POINTER(pw_settings), _p, c.c_long, _e))
_declare(core, _i, ("pw_repetition_run", _p, c.c_long, _e), ("pw_repetition_error", _p, _p, c.c_long, _p, _p, _e))
_declare(core, None, ("pw_repetition_close", _p))
_declare(core, _d, ("pw_run_time", _p))
_declare(core, _double_p, ("pw_system_mass", _p))
_declare(core, _s, ("pw_system_body_name", _p, _i))
_declare(core, None, ("pw_ensemble_step", _p, _d), ("pw_ensemble_observe", _p), ("pw_archive_free", c.POINTER(pw_archive)))
_declare(core, _i, ("pw_run_save", _p, c.POINTER(pw_archive), _e), ("pw_run_load", _p, c.POINTER(pw_archive), _e),
         ("pw_system_find_signal", _p, _s, _e), ("pw_system_has_lanes", _p))
_declare(files, _p, ("pw_scene_lanes_open", _p, _p, _i, _e), ("pw_scene_code_lanes", _p))
_declare(files, _i, ("pw_processor_lanes",))
_declare(core, c.POINTER(pw_event), ("pw_run_events", _p, c.POINTER(_i)))
_declare(core, _s, ("pw_system_mode_name", _p, _i, _i), ("pw_system_reaction_name", _p, _i, _s, _z))
_declare(core, _i, ("pw_run_find_crossing", _p, c.POINTER(pw_crossing), _double_p, _e))
_declare(files, _p, ("pw_condition_open", _p, _s, _e))
_declare(files, _i, ("pw_condition_needs_ledger", _p))
_declare(files, None, ("pw_condition_close", _p))
_declare(core, _i, ("pw_method_parse", _s, _p, c.POINTER(_p), _p, _e), ("pw_method_adaptive", _p, _s),
         ("pw_system_contacts", _p), ("pw_system_outputs", _p))
_declare(core, c.POINTER(pw_element), ("pw_model_elements", _p, c.POINTER(_i)))
_declare(core, c.POINTER(pw_initial_report), ("pw_run_initial", _p))
_declare(core, _i, ("pw_specialised_fits", _p, _p), ("pw_initial_moved", _p, c.POINTER(pw_initial_report), _i),
         ("pw_initial_given", c.POINTER(pw_initial_report), _i), ("pw_initial_specified", c.POINTER(pw_initial_report), _i))
_declare(core, c.POINTER(pw_statistics), ("pw_run_statistics", _p))


def check(error) -> None:
    """Raises the exception of a library error, if there is one."""
    if error.status < 0:
        raise _EXCEPTIONS.get(error.status, Error)(error.text.decode(errors="replace"))


class Handle:
    """A C object, deleted with this one, and the objects that it needs, which live longer.

    Python drops what handlers of signals raise in finalizers, therefore this one has no instructions of Python.  Arrays of
    objects hide from Python's collector of cycles that the other objects can be deleted, too.
    """

    __del__ = property(operator.attrgetter("_delete"))

    def __init__(self, pointer, delete, *needed):
        self.pointer, self._delete, self._needed = pointer, functools.partial(delete, pointer), np.empty(1, object)
        self._needed[0] = needed


# ---- Calls during which the library calls functions in Python ----

class _Thread(threading.local):
    call: Call | None = None  # the innermost one


thread = _Thread()


class Call:
    """A context for calls of the library that call functions in Python.

    No exception passes through C: the functions return a failure, and `check` raises the exception.  Python calls handlers
    of signals between any two instructions, also before the first one of a function that C calls or after its last one,
    where ctypes would drop what they raise.  They are therefore replaced: what one raises passes only while `inside` is
    set, and is kept in every case.
    """

    failure: BaseException | None = None  # what a function or a handler has raised; functions fail from then on
    of_function = False  # a function has raised it
    inside = False  # set while exceptions pass: they reach a function that is prepared for them
    _active = False

    def __init__(self):
        self._handlers, self._outer = {}, None

    def __enter__(self) -> Call:
        self._outer, thread.call = thread.call, self
        try:
            for number in range(1, signal.NSIG) if threading.current_thread() is threading.main_thread() else ():
                handler = signal.getsignal(number)
                while isinstance(owner := getattr(handler, "__self__", None), Call) and not owner._active:
                    handler = owner._handlers[number]  # an interrupt has kept it from being removed
                if callable(handler):
                    self._handlers[number] = handler
                    signal.signal(number, self._handle)
            self._active = True
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        thread.call = self._outer
        try:
            self._active = False  # from here on exceptions of handlers pass
            self._restore()
        finally:
            self._restore()  # what such an exception has left

    def _restore(self):
        for number, handler in self._handlers.items():
            if isinstance(getattr(signal.getsignal(number), "__self__", None), Call):  # no function has set another one
                signal.signal(number, handler)

    def _handle(self, number, frame):
        try:
            self._handlers[number](number, frame)
        except BaseException as failure:
            if self._active and self.failure is None:
                self.failure = failure
            if self.inside or not self._active:
                raise

    def passing(self, function, *arguments):
        """Calls a function in Python that handlers of signals may interrupt; raises also what they have raised in finalizers."""
        with self:
            try:
                self.inside = True
                result = function(*arguments)
            finally:
                self.inside = False
        self.check(pw_error())
        return result

    def check(self, error) -> None:
        """Raises what a function or a handler has raised, else the exception of the library's error."""
        failure, self.failure = self.failure, None
        if failure is None:
            check(error)
            return
        if self.of_function:
            reason = text(error.text) or "a signal failed"
            set_attribute(failure, "_reason", reason)
            set_attribute(failure, "__notes__", [*getattr(failure, "__notes__", ()), reason])  # tracebacks show them
        try:
            raise failure
        finally:
            del failure  # a cycle: its traceback has this frame


def raised_by_function(failure: BaseException) -> str:
    """The library's text on the signal whose function has raised this exception; "" if none has."""
    return getattr(failure, "_reason", "")


def set_attribute(failure: BaseException, name: str, value) -> None:
    """Sets an attribute of an exception, also of one whose class forbids that to its users."""
    with contextlib.suppress(AttributeError):
        BaseException.__setattr__(failure, name, value)


def text(value: bytes | None) -> str:
    return value.decode(errors="replace") if value else ""


def encode(value, what: str) -> bytes:
    """A text as the library takes it."""
    if not isinstance(value, str) or "\0" in value:
        raise InputError(f"{what}: expected a text, found {value!r:.60}")
    return value.encode(errors="replace")


def number(value, what: str, above: float | None = None) -> float:
    """A number, or an expression of numbers ("30*deg"); with `above`, it must be finite and larger than that."""
    result, hint = c.c_double(), c.create_string_buffer(100)
    try:
        if not isinstance(value, str):
            result.value = float(value)
        elif files.pw_read_expression(encode(value, what), c.byref(result)) != PW_OK:
            files.pw_number_hint(encode(value, what), hint, len(hint))
            raise ValueError
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{what} = {value!r:.60}: expected a number{hint.value.decode()}") from None
    if above is not None and not above < result.value < float("inf"):
        raise InputError(f"{what} = {result.value!r}: expected a finite number > {above:g}")
    return result.value


def numbers(values, what: str) -> dict:
    """Numbers by name."""
    if not hasattr(values, "items"):
        raise InputError(f"{what}: expected a dict of numbers by name, found {values!r:.60}")
    return {encode(name, what).decode(): number(value, str(name)) for name, value in values.items()}


free = c.CDLL(None).free  # for texts that the library allocates
free.restype, free.argtypes = None, [c.c_void_p]


def name_of(function, *arguments) -> str:
    """The name or notice that a function of the library writes into a buffer."""
    buffer = c.create_string_buffer(600)
    function(*arguments, buffer, 600)
    return buffer.value.decode()
