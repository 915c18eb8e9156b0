"""Damaged files: what reads them says that they are damaged, or uses the numbers that were written."""

from __future__ import annotations

import random
import re
from pathlib import Path

from benchmarks.hostile.attack import Ended, Report, command, configuration, contents, end, here, start

#: What a command may say of a damaged file.
_TOLD = re.compile(r"damaged|no seal|was not written by ringsweep")


def _flip(content: bytearray, draw: random.Random, bits: int) -> None:
    for _ in range(bits):
        content[draw.randrange(len(content))] ^= 1 << draw.randrange(8)


def _overwrite(content: bytearray, draw: random.Random, noise: bool) -> None:
    length = draw.choice([1, 8, 64, 512, 4096])
    at = draw.randrange(len(content))
    length = min(length, len(content) - at)
    content[at : at + length] = draw.randbytes(length) if noise else bytes(length)


DAMAGES = {
    "one bit": lambda content, draw: _flip(content, draw, 1),
    "some bits": lambda content, draw: _flip(content, draw, draw.randint(2, 16)),
    "zeros": lambda content, draw: _overwrite(content, draw, False),
    "noise": lambda content, draw: _overwrite(content, draw, True),
    "truncation": lambda content, draw: content.__delitem__(slice(draw.randrange(len(content)), None)),
}


def damaged_files(folder: Path, count: int, seed: int) -> Report:
    """Damage files at random, then run `info`, `verify`, and `run --reuse` or `plot` on each."""
    draw, report = random.Random(seed), Report()
    configs = {
        "small": configuration(folder / "small.yaml", 3, 2),
        "large": configuration(folder / "large.yaml", 40, 30),
    }
    for name, config in configs.items():
        here("run", config, "-o", folder / f"{name}.nc")
    here("simulate", configs["small"], "-o", folder / "history.nc")
    names = ["small", "large", "history"]
    whole = {name: (folder / f"{name}.nc").read_bytes() for name in names}
    stored = {name: contents(folder / f"{name}.nc") for name in names}
    told_of_whole = {}
    work = folder / "work"
    work.mkdir()
    victim, new, picture = work / "victim.nc", work / "new.nc", work / "picture.png"
    for name in names:
        victim.write_bytes(whole[name])
        told_of_whole[name] = command("info", victim).text
    assert not command("plot", victim, "-o", picture).status
    drawn = picture.read_bytes()

    def equal(path: Path, name: str) -> bool:
        return not end(start(lambda: int(contents(path) != stored[name]))).status

    for number in range(count):
        name, damage = draw.choice(names), draw.choice(list(DAMAGES))
        content = bytearray(whole[name])
        DAMAGES[damage](content, draw)
        if content == whole[name]:
            report.add(f"{damage}: no byte changed")
            continue
        victim.write_bytes(content)
        ends = {"verify": command("verify", victim), "info": command("info", victim)}
        if name == "history":
            ends["plot"] = command("plot", victim, "-o", picture)
        else:
            ends["reuse"] = command("run", configs[name], "--reuse", victim, "-o", new)
        same = {
            "verify": lambda name=name: equal(victim, name),
            "info": lambda name=name, told=ends["info"]: _but_seal(told.text) == _but_seal(told_of_whole[name]),
            "reuse": lambda name=name: equal(new, name),
            "plot": lambda: picture.read_bytes() == drawn,
        }
        problem = "; ".join(
            f"{verb}: {complaint}"
            for verb, ended in ends.items()
            if (complaint := ended.complaint((0, 2)) or _silence(ended, same[verb]))
        )
        known = {"victim.nc", "new.nc", "new.png", "picture.png"}
        left = sorted({path.name for path in work.iterdir()} - known)
        problem = problem or (f"left behind: {', '.join(left)}" if left else "")
        told = sum(ended.status == 2 for ended in ends.values())
        outcome = "told by all" if told == len(ends) else "harmless: the same numbers" if not told else "told by some"
        report.add(
            f"{damage}: {outcome}", problem and f"files, seed {seed}, number {number}, {name}, {damage}: {problem}"
        )
        if problem:
            (folder.parent / f"hostile-{seed}-{number}.nc").write_bytes(content)
        for path in (new, work / "new.png"):
            path.unlink(missing_ok=True)
    return report


def _silence(ended: Ended, same: object) -> str:
    """Why the end of a command hides damage; empty if it does not."""
    if ended.status == 0:
        assert callable(same)
        return "" if "no seal" in ended.text or same() else "other numbers in silence"
    return "" if _TOLD.search(ended.text) else f"the cause is not told: {ended.last}"


def _but_seal(text: str) -> list[str]:
    return [line for line in text.splitlines() if not line.startswith("seal:")]
