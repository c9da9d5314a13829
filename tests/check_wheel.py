"""Build sdist -> wheel, compare the wheel with the three folders, install it elsewhere and import it.

A package that pyproject's list leaves out, or a file that package-data leaves out, vanishes silently.
"""

import subprocess
import sys
import tempfile
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = {"filippov": "filippov", "filippov/models": "models", "filippov/analysis": "analysis"}
IMPORTS = "import filippov, filippov.models, filippov.analysis; print(filippov.__file__)"


def expected() -> set[str]:
    """Names that the wheel must hold: every file of the three folders under its import path."""
    return {
        f"{inside}/{path.relative_to(ROOT / folder).as_posix()}"
        for inside, folder in FOLDERS.items()
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def run(*command: str | Path, cwd: Path | None = None) -> str:
    """Standard output of a command that must succeed."""
    return subprocess.run(command, check=True, cwd=cwd, stdout=subprocess.PIPE, text=True).stdout


def main() -> int:
    """Exit code 0 if the wheel holds exactly the three folders and works outside the checkout."""
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        run(sys.executable, "-m", "build", "--outdir", work, ROOT)
        (wheel,) = work.glob("*.whl")
        with zipfile.ZipFile(wheel) as archive:
            held = {name for name in archive.namelist() if ".dist-info/" not in name}
        missing, extra = sorted(expected() - held), sorted(held - expected())
        if missing or extra:
            print(f"wheel {wheel.name}: missing {missing}, not in the folders {extra}", file=sys.stderr)
            return 1
        venv.create(work / "venv", with_pip=True)
        python = work / "venv" / "bin" / "python"
        run(python, "-m", "pip", "install", "--quiet", wheel)
        # -P and another directory: nothing of the checkout may be on the path.
        place = Path(run(python, "-P", "-c", IMPORTS, cwd=work).strip())
        if not place.is_relative_to(work / "venv"):
            print(f"imported {place}, expected a file below {work / 'venv'}", file=sys.stderr)
            return 1
        print(f"{wheel.name}: {len(held)} files, as in the three folders; imports outside the checkout")
    return 0


if __name__ == "__main__":
    sys.exit(main())
