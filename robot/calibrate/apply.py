"""Puts values into a TOML text and leaves everything else, comments too, as it is."""

from __future__ import annotations

import re

from robot.config import parse_config

_HEADER = re.compile(r"\s*\[\s*([A-Za-z0-9_.]+)\s*\]\s*(#.*)?")


def set_keys(text: str, values: dict[str, float | str], name: str = "robot.toml") -> str:
    """`values` by "section.key". Raises ConfigError when the result is no valid configuration."""
    lines = text.splitlines()
    for key, value in values.items():
        section, _, leaf = key.partition(".")
        line = f"{leaf} = {_literal(value)}"
        start, end = _section(lines, section)
        if start is None:
            lines += [*([""] if lines else []), f"[{section}]", line]
            continue
        at = [k for k in range(start, end) if re.match(rf"\s*{re.escape(leaf)}\s*=", lines[k])]
        if at:
            comment = re.search(r"\s+#[^\"']*$", lines[at[0]])
            lines[at[0]] = line + (comment.group() if comment else "")
        else:
            while end > start and not lines[end - 1].strip():
                end -= 1
            lines.insert(end, line)
    changed = "\n".join(lines) + "\n"
    parse_config(changed, name)
    return changed


def _section(lines: list[str], section: str) -> tuple[int | None, int]:
    """First line after the section's header, and the line after its last."""
    start: int | None = None
    for k, line in enumerate(lines):
        match = _HEADER.fullmatch(line)
        if match is None:
            continue
        if start is not None:
            return start, k
        if match.group(1) == section:
            start = k + 1
    return start, len(lines)


def _literal(value: float | str) -> str:
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return repr(round(value, 7))
