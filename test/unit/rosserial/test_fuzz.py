"""The fuzz targets with inputs of hypothesis, and with all that has ever been found (corpus/)."""

import random
import re
from pathlib import Path

import fuzz_targets
import pytest
from hypothesis import given
from hypothesis import strategies as st

CORPUS = sorted(Path(__file__).with_name("corpus").glob("*.hex"))


@pytest.mark.parametrize("path", CORPUS, ids=lambda path: path.stem)
def test_what_was_found(path):
    fuzz_targets.run_one(bytes.fromhex(re.sub(r"#.*", "", path.read_text())))


@pytest.mark.parametrize("target", fuzz_targets.TARGETS, ids=lambda target: target.__name__)
@given(tape=st.binary(max_size=160))
def test_any_tape(target, tape):
    target(tape)


def test_tapes_get_behind_checksum_and_proof(monkeypatch):
    """A target that makes no sense of a tape would find nothing: all kinds of events come."""
    seen = set()
    check = fuzz_targets.check_event

    def note(session, policy, event, proven):
        seen.add(type(event))
        return check(session, policy, event, proven)

    monkeypatch.setattr(fuzz_targets, "check_event", note)
    rng = random.Random(6)
    for number in range(4000):
        fuzz_targets.server(bytes((number % 4,)) + rng.randbytes(rng.randrange(60)))
        if seen == set(fuzz_targets.EVENTS):
            return
    raise AssertionError(f"only {seen} in {number} tapes")
