"""The report of an incident as a browser draws it, on a phone and on a desk."""

import re
import shutil
import subprocess

import pytest

from rosbot_patrol.alerts.records.incident import Event
from rosbot_patrol.alerts.report.page import Evidence, render_report

_MEASURE = """<script>
const lines = cell => {
  const range = document.createRange();
  range.selectNodeContents(cell);
  return range.getClientRects().length;
};
const kinds = Math.max(...[...document.querySelectorAll("td.time + td")].map(lines));
const cut = [...document.querySelectorAll(".phases span")].filter(s => s.scrollWidth > s.clientWidth).length;
document.title = `lines ${kinds} cut ${cut} wider ${document.documentElement.scrollWidth > innerWidth}`;
</script>"""


@pytest.mark.long
@pytest.mark.skipif(shutil.which("chromium") is None, reason="chromium is not installed")
@pytest.mark.parametrize("width", [360, 1100])
def test_no_word_is_split_on_a_phone_or_a_desk(make_incident, tmp_path, width):
    wall = 1_790_000_000.0
    words = ("sensor", "emergency", "returning")
    events = tuple(Event(wall=wall + i, kind=kind, text="sees motion " * 20) for i, kind in enumerate(words))
    path = Event(wall=wall + 9.0, kind="notice", text="maildir:/" + "root" * 40)
    times = (("waiting", wall - 1.0), ("driving", wall), ("looking", wall + 12.0), ("returning", wall + 31.0))
    shown = make_incident(events=(*events, path), times=times, closed=wall + 50.0, confirmed=wall + 14.0)
    page = tmp_path / "report.html"
    text = render_report(shown, Evidence(read=lambda _: None)).replace("Content-Security-Policy", "x-no-policy")
    page.write_text(text.replace("</body>", _MEASURE + "</body>"))
    command = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", f"--window-size={width},2000", "--dump-dom"]
    done = subprocess.run([*command, page.as_uri()], capture_output=True, text=True, timeout=60.0)
    assert "<title>lines 1 cut 0 wider false</title>" in done.stdout, re.findall("<title>.*", done.stdout)
