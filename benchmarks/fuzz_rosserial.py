#!/usr/bin/env python3
"""Fuzzing of the rosserial protocol with millions of inputs: no crash, no hang, bounded memory, nothing forbidden
passes.

    benchmarks/fuzz_rosserial.py [--inputs 10000000] [--engine atheris|mutations] [--seconds S] [--state FILE]

The targets and their checks are in test/unit/rosserial/fuzz_targets.py: parser, server session, device session, and
both with noise between them. `atheris` (pip install atheris, in an environment of its own) is guided by coverage.
`mutations` has no dependency: it changes the corpus and inputs that passed. An input of 5 s, or a process of more than
300 MB, is a fault. With `--state` a run continues the last one, with its corpus beside the file. Faulty inputs are
written to the current folder; put them into test/unit/rosserial/corpus/ as NAME.hex, and the tests run them.
"""

from __future__ import annotations

import in_workspace  # noqa: F401 - first: it finds the interpreter

# isort: split
import argparse
import json
import os
import random
import re
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TESTS = ROOT / "test/unit/rosserial"
CORPUS = TESTS / "corpus"
MAX_LENGTH = 96  # largest input [bytes]
MAX_SECONDS, MAX_MB = 5, 300
sys.path[:0] = [str(TESTS), str(ROOT / "src")]


def known() -> list[bytes]:
    """The inputs of the corpus, and some start inputs for each target."""
    found = [bytes.fromhex(re.sub(r"#.*", "", path.read_text())) for path in sorted(CORPUS.glob("*.hex"))]
    return [*found, *(bytes((target, kind, 2, 30, *range(20))) for target in range(4) for kind in range(14))]


def fuzz_by_coverage(options: argparse.Namespace) -> int:
    """Run atheris in a process of its own, because it ends the process; returns its number of inputs."""
    folder = options.state.with_suffix(".corpus") if options.state else Path("rosserial.corpus")
    folder.mkdir(exist_ok=True)
    for number, data in enumerate(known()):
        (folder / f"known{number}").write_bytes(data)
    arguments = [f"-runs={options.inputs}", f"-max_len={MAX_LENGTH}", f"-timeout={MAX_SECONDS}"]
    arguments += [f"-rss_limit_mb={MAX_MB}", f"-seed={options.seed}", "-print_final_stats=1", "-reload=0"]
    arguments += [f"-max_total_time={options.seconds:.0f}"] if options.seconds else []
    command = [sys.executable, __file__, "--child", *arguments, str(folder)]
    ran = subprocess.run(command, stderr=subprocess.PIPE, text=True, errors="replace", check=False)
    count = re.search(r"number_of_executed_units: (\d+)", ran.stderr)
    print("\n".join(line for line in ran.stderr.splitlines() if re.match(r"#\d+\s+(DONE|INITED)|stat::", line)))
    if ran.returncode or count is None:
        print(ran.stderr[-3000:], file=sys.stderr)
        raise SystemExit(1)
    return int(count[1])


def child(arguments: list[str]) -> None:
    """Main function of the process that atheris ends."""
    import atheris

    with atheris.instrument_imports(include=["rosbot_patrol.rosserial"]):
        from fuzz_targets import run_one
    atheris.Setup([sys.argv[0], *arguments], run_one)
    atheris.Fuzz()


def mutate(data: bytearray, other: bytes, rng: random.Random) -> None:
    """Change an input slightly, or insert a part of another one."""
    at, kind = rng.randrange(len(data)), rng.randrange(6)
    if kind == 0:
        data[at] ^= 1 << rng.randrange(8)
    elif kind == 1:
        data[at] = rng.choice((0, 1, 7, 15, 31, 127, 128, 254, 255, rng.randrange(256)))
    elif kind == 2:
        data[at:at] = rng.randbytes(rng.randrange(1, 9))
    elif kind == 3:
        del data[at : at + rng.randrange(1, 9)]
    elif kind == 4:
        begin = rng.randrange(len(other))
        data[at:at] = other[begin : begin + rng.randrange(1, 33)]
    else:
        data[at:] = other[rng.randrange(len(other)) :]


def fuzz_by_mutation(options: argparse.Namespace) -> int:
    """Change known inputs at random."""
    from fuzz_targets import run_one

    rng, pool = random.Random(options.seed), known()
    until = time.monotonic() + options.seconds if options.seconds else float("inf")
    for number in range(options.inputs):
        data = bytearray(rng.choice(pool))
        for _ in range(rng.randrange(1, 6)):
            if data:
                mutate(data, rng.choice(pool), rng)
        signal.alarm(MAX_SECONDS)  # ends the process
        try:
            run_one(bytes(data[:MAX_LENGTH]))
        except BaseException:
            Path(f"found-{options.seed}-{number}.hex").write_text(data[:MAX_LENGTH].hex() + "\n")
            raise
        if number % 64 == 0 and data:
            pool[rng.randrange(len(pool))] = bytes(data[:MAX_LENGTH])
            if resource.getrusage(resource.RUSAGE_SELF).ru_maxrss > MAX_MB * 1024:
                raise SystemExit(f"more than {MAX_MB} MB after {number} inputs")
        if time.monotonic() > until:
            return number + 1
    return options.inputs


def main() -> int:
    if sys.argv[1:2] == ["--child"]:
        child(sys.argv[2:])
        return 0
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=10_000_000)
    parser.add_argument("--engine", choices=("atheris", "mutations"), default="atheris")
    parser.add_argument("--seconds", type=float, default=0.0, help="stop after that time")
    parser.add_argument("--seed", type=int, default=0, help="0: by the number of inputs so far")
    parser.add_argument("--state", type=Path, metavar="FILE", help="count all runs together, by engine")
    options = parser.parse_args()
    state = json.loads(options.state.read_text()) if options.state and options.state.exists() else {}
    done = state.get(options.engine, {"inputs": 0, "seconds": 0.0})
    options.inputs -= done["inputs"]
    if options.inputs <= 0:
        print(f"{done['inputs']} inputs have been tried")
        return 0
    options.seed = options.seed or done["inputs"] % 1_000_000_007 + 1
    began = time.monotonic()
    fuzz = fuzz_by_coverage if options.engine == "atheris" else fuzz_by_mutation
    done["inputs"] += fuzz(options)
    done["seconds"] += time.monotonic() - began
    children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    most = max(children, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) / 1024
    print(f"{options.engine}: {done['inputs']} inputs in {done['seconds']:.0f} s, nothing found, at most {most:.0f} MB")
    if options.state:
        options.state.write_text(json.dumps(state | {options.engine: done}))
    return 0


if __name__ == "__main__":
    os.environ.setdefault("PYTHONHASHSEED", "0")
    sys.exit(main())
