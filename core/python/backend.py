"""Builds the wheel: the package and, if ../../build exists, the libraries, the program and the models (PEP 517).

Needs nothing but Python, so that ``pip install core/python`` works without a network.
"""

import base64
import hashlib
import pathlib
import shutil
import stat
import subprocess
import sysconfig
import tempfile
import zipfile

_HERE = pathlib.Path(__file__).resolve().parent
_NAME, _VERSION = "pinwheel", "0.1.0"


def _contents():
    """Pairs of a name in the wheel and the path of the file."""
    for path in sorted((_HERE / "pinwheel").glob("*.py")) + [_HERE / "pinwheel/py.typed"]:
        yield f"pinwheel/{path.name}", path
    build = _HERE.parent.parent / "build"
    for path in [*sorted(build.glob("libpinwheel*.so.*")), build / "pinwheel"]:
        if path.exists():
            yield f"pinwheel/lib/{path.name}", path
    for folder, pattern in (("models", "*.so"), ("models", "*.c"), ("models", "*.yaml"), ("include", "*.h"), ("page", "pinwheel*")):
        for path in sorted((build / folder).glob(pattern)):
            yield f"pinwheel/lib/{folder}/{path.name}", path


def _read(path):
    """The bytes of a file; libraries and programs without debugging information, which has paths of the source tree."""
    if not path.read_bytes().startswith(b"\x7fELF") or shutil.which("strip") is None:
        return path.read_bytes()
    with tempfile.TemporaryDirectory() as folder:
        stripped = pathlib.Path(folder) / path.name
        subprocess.run(["strip", "--strip-debug", "-o", stripped, path], check=True)
        return stripped.read_bytes()


def _tag(native):
    """The tag of a wheel with or without compiled files (PEP 425)."""
    return f"py3-none-{sysconfig.get_platform().replace('-', '_').replace('.', '_')}" if native else "py3-none-any"


def build_wheel(directory, config_settings=None, metadata_directory=None):
    """Writes the wheel to the directory and returns its file name (PEP 517)."""
    contents = [(name, _read(path), path.stat().st_mode) for name, path in _contents()]
    tag = _tag(any("/lib/" in name for name, _, _ in contents))
    info = f"{_NAME}-{_VERSION}.dist-info"
    metadata = f"Metadata-Version: 2.1\nName: {_NAME}\nVersion: {_VERSION}\nRequires-Dist: numpy\nRequires-Python: >=3.9\n"
    contents += [(f"{info}/METADATA", metadata.encode(), 0o644),
                 (f"{info}/WHEEL", f"Wheel-Version: 1.0\nGenerator: pinwheel\nRoot-Is-Purelib: false\nTag: {tag}\n".encode(), 0o644)]
    file, record = f"{_NAME}-{_VERSION}-{tag}.whl", []
    with zipfile.ZipFile(pathlib.Path(directory) / file, "w", zipfile.ZIP_DEFLATED) as wheel:
        for name, data, mode in contents:
            entry = zipfile.ZipInfo(name)
            entry.external_attr = (mode & 0o777 | stat.S_IFREG) << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            wheel.writestr(entry, data)
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            record.append(f"{name},sha256={digest},{len(data)}")
        wheel.writestr(f"{info}/RECORD", "\n".join([*record, f"{info}/RECORD,,", ""]))
    return file
