"""How the report looks: on a phone, on a desk, in the dark, on paper."""

STYLE = """
:root { color-scheme: light dark; --ink:#1c2430; --faint:#5c6878; --paper:#fff; --card:#f4f6f9; --line:#d5dbe3;
  --confirmed:#b3261e; --clear:#1b7a43; --unreachable:#8a5a00; --unverified:#8a5a00; --running:#2a5db0; }
@media (prefers-color-scheme: dark) { :root { --ink:#e6eaf0; --faint:#9aa7b8; --paper:#12161c; --card:#1c222b;
  --line:#343d4a; --confirmed:#ff6b61; --clear:#53c786; --unreachable:#e0a23c; --unverified:#e0a23c;
  --running:#7fa8f0; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1rem; max-width: 60rem; background: var(--paper); color: var(--ink);
  font: 16px/1.45 system-ui, "Noto Sans", "DejaVu Sans", sans-serif; overflow-wrap: anywhere; }
header { border-left: .5rem solid; padding: .2rem 0 .2rem .9rem; margin-bottom: 1.2rem; }
h1 { font-size: 1.5rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-size: 1.1rem; margin: 1.6rem 0 .6rem; }
p { margin: .3rem 0; }
.verdict { font-weight: 700; text-transform: uppercase; letter-spacing: .04em; }
.confirmed { color: var(--confirmed); } .clear { color: var(--clear); } .running { color: var(--running); }
.unreachable { color: var(--unreachable); } .unverified { color: var(--unverified); }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; vertical-align: top; padding: .3rem .6rem .3rem 0; border-bottom: 1px solid var(--line); }
th, td { overflow-wrap: break-word; } /* a column is as wide as its longest word */
td:last-child { overflow-wrap: anywhere; } /* but paths and digests must not widen the page */
th { color: var(--faint); font-weight: 500; white-space: nowrap; }
td.time { white-space: nowrap; font-variant-numeric: tabular-nums; }
figure { margin: 0 0 .8rem; }
figcaption, footer, .faint { color: var(--faint); font-size: .85rem; }
figure img { display: block; width: 100%; height: auto; border-radius: .4rem; background: #fff; }
.best { display: grid; gap: .8rem; grid-template-columns: repeat(auto-fit, minmax(min(20rem, 100%), 1fr)); }
.strip { display: grid; gap: .3rem; grid-template-columns: repeat(auto-fill, minmax(6.5rem, 1fr)); }
.strip figure { margin: 0; } .strip figcaption { font-size: .7rem; text-align: center; }
.strip .after img { outline: 2px solid var(--confirmed); outline-offset: -2px; }
.phases { display: flex; flex-wrap: wrap; border-radius: .4rem; overflow: hidden; margin: .4rem 0; font-size: .8rem; }
.phases span { padding: .35rem .2rem; color: #fff; text-align: center; min-width: max-content; white-space: nowrap; }
.waiting, .starting { background: #77808c; } .driving { background: #2a5db0; } .looking { background: #7a3f9d; }
.returning { background: #3c7d80; } .stopped { background: #a33; } .other { background: #556; }
code { font: .8rem/1.3 ui-monospace, "DejaVu Sans Mono", monospace; word-break: break-all; }
details summary { cursor: pointer; color: var(--faint); }
@media print { :root { --ink:#000; --faint:#444; --paper:#fff; --line:#bbb; --card:#fff; }
  body { max-width: none; padding: 0; font-size: 11pt; }
  figure, tr, .phases { break-inside: avoid; } h2 { break-after: avoid; }
  .phases span { -webkit-print-color-adjust: exact; print-color-adjust: exact; } }
"""
