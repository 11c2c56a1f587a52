"""A small wheelhouse: pip, and a T2 that prints its arguments."""

import base64
import ensurepip
import hashlib
import shutil
import subprocess
import zipfile
from pathlib import Path

SCRIPT = Path(__file__).parents[2] / "deploy" / "t2-install.sh"
OFFLINE = ("unshare", "--map-root-user", "--net")  # root of nothing, and without a network

MAIN = """
import os, sys
print("t2", "{version}", *sys.argv[1:])
refused = os.environ.get("T2_TEST_REFUSES") in ("{version}", *sys.argv)
sys.exit("the settings will not do" if refused else 0)
"""


def offline() -> str:
    """Return why programs cannot run without a network here; empty if they can."""
    try:
        done = subprocess.run([*OFFLINE, "true"], capture_output=True, text=True, check=False)
    except OSError as error:
        return str(error)
    return done.stderr.strip() if done.returncode else ""


def bundled_pip() -> Path | None:
    """Return the pip wheel bundled with Python, if any."""
    found = (Path(ensurepip.__file__).parent / "_bundled").glob("pip-*.whl")
    return next(found, None)


def wheel(folder: Path, version: str) -> Path:
    """Write T2's wheel."""
    info = f"t2-{version}.dist-info"
    texts = {
        "cli/__init__.py": "",
        "cli/__main__.py": MAIN.replace("{version}", version),
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: t2\nVersion: {version}\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    record = [f"{name},sha256={digest(text.encode())},{len(text)}" for name, text in texts.items()]
    texts[f"{info}/RECORD"] = "\n".join([*record, f"{info}/RECORD,,", ""])
    path = folder / f"t2-{version}-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in texts.items():
            archive.writestr(zipfile.ZipInfo(name), text)
    return path


def digest(data: bytes) -> str:
    """Return a hash in the format of a wheel's record."""
    return base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()


def wheelhouse(folder: Path, version: str, pip: Path) -> Path:
    """Write a complete wheelhouse, as `make wheelhouse` does."""
    folder.mkdir()
    made = wheel(folder, version)
    shutil.copy(pip, folder)
    shutil.copy(SCRIPT, folder)
    sha256 = hashlib.sha256(made.read_bytes()).hexdigest()
    (folder / "requirements.txt").write_text(f"t2=={version} --hash=sha256:{sha256}\n")
    (folder / "VERSION").write_text(f"{version}\n")
    (folder / "PLATFORM").write_text("any\n")
    seal(folder)
    return folder


def seal(folder: Path) -> None:
    """Write the checksums of a wheelhouse."""
    files = sorted(path for path in folder.iterdir() if path.name != "SHA256SUMS")
    sums = (f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files)
    (folder / "SHA256SUMS").write_text("".join(sums))
