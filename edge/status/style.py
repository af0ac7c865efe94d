"""The page's style sheet: one column, large numbers, dark where the reader's system is."""

STYLE = """
:root { --ground:#f4f6f2; --card:#fff; --ink:#1d2a22; --quiet:#66736a; --rule:#e1e7e0; --green:#2f7d4f;
  --amber:#9a6200; --amber-ground:#fdf1d8; --red:#ac2f25; --red-ground:#fbe4e1; --green-ground:#e0f2e6;
  --blue:#2c6fb0; --orange:#d0722a; }
@media (prefers-color-scheme: dark) { :root { --ground:#121814; --card:#1b231e; --ink:#e4ebe5; --quiet:#93a197;
  --rule:#2c3730; --green:#6cc48d; --amber:#eab85c; --amber-ground:#3a2f16; --red:#f08b80; --red-ground:#40201d;
  --green-ground:#1d3a29; --blue:#79b4ea; --orange:#f0a35f; } }
* { box-sizing:border-box; margin:0; }
body { background:var(--ground); color:var(--ink); font:15px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,sans-serif; }
main { max-width:62rem; margin:0 auto; padding:1.5rem 1rem 3rem; display:flex; flex-direction:column; gap:1rem; }
header { display:flex; justify-content:space-between; align-items:flex-start; gap:1rem; }
h1 { font-size:1.6rem; line-height:1.2; }
h2 { font-size:1rem; margin-bottom:.6rem; }
section { background:var(--card); border:1px solid var(--rule); border-radius:.7rem; padding:1rem 1.2rem; }
section.cards { background:none; border:0; padding:0; display:grid; gap:1rem;
  grid-template-columns:repeat(auto-fit,minmax(11rem,1fr)); }
.card { background:var(--card); border:1px solid var(--rule); border-radius:.7rem; padding:.9rem 1.1rem; }
.lead { border-left:.35rem solid var(--green); }
.who { font-size:1.25rem; font-weight:600; }
.quiet { color:var(--quiet); }
.big { font-size:1.7rem; font-weight:600; line-height:1.25; font-variant-numeric:tabular-nums; }
.big small { font-size:.9rem; font-weight:400; color:var(--quiet); }
.up { color:var(--green); } .down { color:var(--red); }
.pill { border-radius:2rem; padding:.25rem .9rem; font-weight:600; white-space:nowrap; }
.tag { border-radius:.4rem; padding:.05rem .45rem; font-size:.85rem; background:var(--ground); }
.pill.good { background:var(--green-ground); color:var(--green); }
.pill.warn, .tag.warn { background:var(--amber-ground); color:var(--amber); }
.pill.bad { background:var(--red-ground); color:var(--red); }
.troubles { list-style:none; padding:0; display:flex; flex-direction:column; gap:.4rem; }
.troubles li { border-radius:.4rem; padding:.35rem .7rem; }
.troubles .bad { background:var(--red-ground); color:var(--red); }
.troubles .warn { background:var(--amber-ground); color:var(--amber); }
.money { display:flex; gap:2.5rem; flex-wrap:wrap; margin-bottom:.5rem; }
.scroll { overflow-x:auto; }
table { width:100%; border-collapse:collapse; font-variant-numeric:tabular-nums; }
th { text-align:left; font-weight:500; color:var(--quiet); }
th, td { padding:.35rem .9rem .35rem 0; border-bottom:1px solid var(--rule); vertical-align:middle; }
tr:last-child td { border-bottom:0; }
.number { text-align:right; white-space:nowrap; }
td small, th small { color:var(--quiet); }
td:first-child { white-space:nowrap; }
summary { cursor:pointer; font-weight:600; }
section p + p, section p + .scroll, .legend { margin-top:.4rem; }
svg { display:block; max-width:100%; }
.spark polyline { fill:none; stroke:var(--green); stroke-width:1.5; stroke-linejoin:round; }
.spark circle { fill:var(--green); }
.chart { width:100%; height:auto; margin-top:.3rem; }
.chart polyline { fill:none; stroke-width:2; stroke-linejoin:round; }
.chart .measured { stroke:var(--green); } .chart .expected { stroke:var(--green); stroke-dasharray:5 4; }
.chart .setpoint { stroke:var(--orange); stroke-width:1.5; }
.chart .grid { stroke:var(--rule); } .chart .axis { fill:var(--quiet); font-size:11px; }
.chart .ahead { fill:var(--blue); opacity:.07; } .chart .now { fill:var(--blue); font-size:11px; }
.legend { display:flex; flex-wrap:wrap; gap:1.2rem; color:var(--quiet); font-size:.85rem; }
.key::before { content:""; display:inline-block; width:1.4rem; margin-right:.4rem; vertical-align:middle;
  border-top:2px solid var(--green); }
.key.expected::before { border-top-style:dashed; } .key.setpoint::before { border-top-color:var(--orange); }
footer { color:var(--quiet); font-size:.85rem; }
code { font-size:.9em; }
"""
