"""The walls of the house: who may import whom, who is pure, and how large a file may grow."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
GROUND = {"geometry", "errors"}
TABLE = GROUND | {"messages", "config"}
RIGHTS: dict[str, set[str]] = {
    "geometry": set(),
    "errors": set(),
    "messages": GROUND,
    "config": GROUND,
    "perception": TABLE,
    "slam": TABLE,
    "mapping": TABLE,
    "planning": TABLE,
    "control": TABLE,
    "mission": TABLE | {"mapping", "planning", "control"},
    "home": TABLE | {"slam", "mapping"},
    "brain": TABLE | {"home", "slam", "mapping", "planning", "control", "mission"},
    "hardware": TABLE | {"firmware_bridge"},
    "calibrate": TABLE | {"perception"},
    "sim": TABLE,
    "log": TABLE,
    "evaluate": TABLE,
    "serve": {"errors", "body"},  # of body, the stream's frames only
}
PURE = {"geometry", "messages", "perception", "slam", "mapping", "planning", "control", "mission"}
PURE_FILES = {"brain", "home", "run"}
IMPURE_MODULES = {
    "time", "threading", "os", "random", "multiprocessing", "subprocess", "socket", "tempfile",
    "datetime", "asyncio", "concurrent", "secrets", "shutil", "pathlib", "io", "glob", "select",
}  # fmt: skip
HEAVY = {"numba", "trimesh", "onnxruntime", "filterpy", "mcap", "rich", "torch", "scipy", "serial"}
HEAVY_AT_TOP = {
    "robot/sim": {"numba"},
    "robot/slam/ekf.py": {"filterpy", "scipy"},
    "robot/log": {"mcap"},
    "models": {"torch", "onnxruntime"},
}
MAX_LINES = 400
MAX_FILES = 24
TOP_LEVEL = {"robot", "firmware_bridge", "models", "deploy", "systemd", "tests"}


def python_files(folder: str) -> list[Path]:
    return sorted((ROOT / folder).rglob("*.py"))


def imports(path: Path, *, top_only: bool = False) -> list[str]:
    """Every module imported for use; imports for type checking only are left out."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            node.body = []
    nodes = tree.body if top_only else ast.walk(tree)
    names: list[str] = []
    for node in nodes:
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names.append(node.module or "")
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


def room(path: Path) -> str:
    return path.relative_to(ROOT / "robot").parts[0].removesuffix(".py")


def room_of_import(name: str) -> str | None:
    parts = name.split(".")
    if parts[0] == "robot" and len(parts) > 1:
        return parts[1]
    return parts[0] if parts[0] in {"firmware_bridge", "models"} else None


@pytest.mark.parametrize("path", python_files("robot"), ids=lambda p: str(p.relative_to(ROOT)))
def test_a_room_imports_only_what_it_may(path):
    allowed = RIGHTS.get(room(path))
    if allowed is None:
        return
    used = {room_of_import(name) for name in imports(path)} - {None, room(path), "__version__"}
    assert used <= allowed, f"{room(path)} may not import {sorted(used - allowed)}"


def test_serve_knows_nothing_of_the_robot_but_its_socket():
    for path in python_files("robot/serve"):
        used = {n for n in imports(path) if n.startswith("robot.body.")} - {"robot.body.talk"}
        assert all(n.startswith("robot.body.talk.stream") for n in used), path
    code = "import sys, robot.serve.app, robot.serve.broker.mqtt; print('numpy' in sys.modules)"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "False"


def test_firmware_bridge_knows_nothing_of_the_robot():
    for path in python_files("firmware_bridge"):
        assert not [n for n in imports(path) if n.split(".")[0] in {"robot", "models"}], path


def test_the_robot_never_imports_training_code():
    for path in python_files("robot"):
        names = {n.split(".")[0] for n in imports(path)}
        assert "torch" not in names, path
        if room(path) != "bench":
            assert "models" not in names, path


@pytest.mark.parametrize("path", python_files("robot"), ids=lambda p: str(p.relative_to(ROOT)))
def test_pure_rooms_touch_neither_clock_nor_files_nor_chance(path):
    if room(path) not in PURE | PURE_FILES:
        return
    used = {n.split(".")[0] for n in imports(path)}
    assert not used & IMPURE_MODULES, f"impure: {sorted(used & IMPURE_MODULES)}"
    calls = {
        ast.unparse(node.func)
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
    }
    assert "open" not in calls and "print" not in calls
    assert not {c for c in calls if c.startswith("np.random.") and "default_rng" not in c}


def test_heavy_packages_are_imported_where_they_are_used():
    for folder in ("robot", "firmware_bridge", "models"):
        for path in python_files(folder):
            name = str(path.relative_to(ROOT))
            allowed = {
                h
                for prefix, heavy in HEAVY_AT_TOP.items()
                if name.startswith(prefix)
                for h in heavy
            }
            heavy = {n.split(".")[0] for n in imports(path, top_only=True)} & HEAVY
            assert heavy <= allowed, f"{name}: import {sorted(heavy - allowed)} inside the function"


def test_files_stay_small():
    long = {
        str(p.relative_to(ROOT)): n
        for folder in ("robot", "firmware_bridge", "models")
        for p in python_files(folder)
        if (n := len(p.read_text(encoding="utf-8").splitlines())) > MAX_LINES
    }
    assert not long


def test_rooms_stay_small():
    shelf = ROOT / "robot/serve/capabilities"  # one alike beside the other
    folders = [p for p in (ROOT / "robot").rglob("*") if p.is_dir() and p != shelf]
    full = {p.name: n for p in folders if (n := len(list(p.glob("*.py")))) > MAX_FILES}
    assert not full, "too many files in one room: draw a wall"


def test_the_top_level_is_the_agreed_one():
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if listed.returncode != 0:
        pytest.skip("not a git checkout")
    folders = {f.split("/")[0] for f in listed.stdout.splitlines() if "/" in f}
    assert {f for f in folders if not f.startswith(".")} == TOP_LEVEL
