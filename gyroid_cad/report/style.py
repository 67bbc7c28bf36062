"""The page's style sheet: light, dark and on paper."""

__all__ = ["STYLE"]

STYLE = """
:root { color-scheme: light dark; --paper: #fbfaf7; --card: #ffffff; --ink: #23211d; --faint: #77716a; --line: #e4dfd6;
  --bar: #d9a441; --accent: #2f6da3; --good: #2c7a4b; --bad: #b23a2e; }
@media (prefers-color-scheme: dark) { :root { --paper: #191817; --card: #232120; --ink: #ece8e1; --faint: #a29b92;
  --line: #3a3734; --bar: #d9a441; --accent: #7fb2df; --good: #6cc492; --bad: #ef8a7d; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink); line-height: 1.5; font-size: 15px;
  font-family: system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", "Noto Sans", sans-serif; }
main { max-width: 1080px; margin: 0 auto; padding: 40px 28px 64px; }
header p { margin: 4px 0 0; color: var(--faint); }
h1 { font-size: 30px; line-height: 1.2; margin: 0; letter-spacing: -0.01em; overflow-wrap: anywhere; }
h2 { font-size: 19px; margin: 0 0 4px; letter-spacing: -0.005em; }
h3 { font-size: 15px; margin: 20px 0 2px; }
section { margin-top: 28px; background: var(--card); border: 1px solid var(--line); border-radius: 10px;
  padding: 22px 24px 24px; }
.note { color: var(--faint); margin: 0 0 12px; max-width: 78ch; }
.facts { display: grid; grid-template-columns: repeat(auto-fit, minmax(150px, 1fr)); gap: 12px; margin-top: 24px; }
.fact { background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: 12px 16px; }
.fact b { display: block; font-size: 21px; font-weight: 600; font-variant-numeric: tabular-nums; }
.fact span { color: var(--faint); font-size: 13px; }
.views { display: grid; grid-template-columns: repeat(6, 1fr); gap: 8px 20px; }
figure { margin: 0; grid-column: span 2; text-align: center; align-self: end; }
figure:first-child { grid-column: span 6; }
figure img { max-width: 100%; height: auto; max-height: 340px; }
figure:first-child img { max-height: 520px; }
figcaption { color: var(--faint); font-size: 13px; }
.key { display: inline-block; width: 11px; height: 11px; border-radius: 3px; margin: 0 4px 0 12px; vertical-align: -1px;
  border: 1px solid var(--line); }
.key:first-child { margin-left: 0; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 6px 18px 6px 0; border-bottom: 1px solid var(--line); vertical-align: top; }
tr:last-child > * { border-bottom: 0; }
th { font-weight: 400; color: var(--faint); }
table.facts-table th { width: 42%; }
thead th { font-size: 13px; }
td { overflow-wrap: anywhere; }
td.number, th.number { text-align: right; padding-right: 4px; padding-left: 14px; white-space: nowrap; }
.yes { color: var(--good); } .no { color: var(--bad); }
.columns { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(420px, 100%), 1fr)); gap: 8px 36px; }
.chart { width: 100%; max-width: 640px; height: auto; display: block; margin: 6px 0 2px; }
.chart .bar { fill: var(--bar); } .chart .grid { stroke: var(--line); } .chart .axis { stroke: var(--faint); }
.chart .mark { stroke: var(--accent); stroke-width: 1.5; stroke-dasharray: 5 4; }
.chart .tick { fill: var(--faint); font-size: 12px; font-family: inherit; }
footer { color: var(--faint); font-size: 13px; margin-top: 28px; }
@media (max-width: 640px) { main { padding: 24px 14px; } figure { grid-column: span 6; } section { padding: 16px; } }
@media print {
  :root { color-scheme: light; --paper: #fff; --card: #fff; --ink: #000; --faint: #555; --line: #ccc; --bar: #d9a441;
    --accent: #2f6da3; --good: #2c7a4b; --bad: #b23a2e; }
  body { font-size: 10.5pt; } main { max-width: none; padding: 0; } section { padding: 10px 14px; margin-top: 14px; }
  figure, table, .chart, .fact, h2, h3 { break-inside: avoid; } h2, h3, .note { break-after: avoid; }
  * { -webkit-print-color-adjust: exact; print-color-adjust: exact; }
}
"""
