"""accuracy_tables.py STUDY RESULTS: accuracy.md and its plots, of a folder that `stipple study SCENE...` wrote."""
import json
import os
import shutil
import sys

study, results = sys.argv[1:]
d = json.load(open(os.path.join(study, "study.json")))
plots = os.path.join(results, "accuracy")
shutil.rmtree(plots, ignore_errors=True)
os.makedirs(plots)
p = d["provenance"]
out = []


def number(value, digits):
    return "-" if value is None else value if isinstance(value, str) else f"{value:.{digits}f}"


def of(rows, mode):
    return sorted((r for r in rows if r["mode"] == mode), key=lambda r: r["error_px"])


def costs(rows):
    """From twice the error down to it: what one more dB and one pixel less cost."""
    for mode in dict.fromkeys(r["mode"] for r in rows):
        line = of(rows, mode)
        for fine, coarse in zip(line, line[1:]):
            gain = fine["errors"]["psnr_foreground_db"] - coarse["errors"]["psnr_foreground_db"]
            ms = fine["ms"]["median"] - coarse["ms"]["median"]
            mb = (fine["errors"]["cut_bytes"] - coarse["errors"]["cut_bytes"]) / 1e6
            less = coarse["errors"]["stated_px"] - fine["errors"]["stated_px"]
            apart = fine["ms"]["low"] > coarse["ms"]["high"]
            took = f"{ms:+.2f}" if apart else f"{ms:+.2f} (not distinguishable)"
            per_db = "no dB to gain" if gain < 0.05 else f"{ms / gain:+.2f} ms, {mb / gain:+.2f} MB"
            per_px = "-" if less < 1e-9 else f"{ms / less:+.2f} ms, {mb / less:+.2f} MB"
            yield mode, coarse["error_px"], fine["error_px"], took, gain, per_db, per_px


out.append("# What accuracy costs\n")
out.append("Made by `STIPPLE_DATA=DATA tests/bench/accuracy_figures.sh` (it runs `stipple study SCENES --quick --blocks 3`: 640 x 360, one camera of")
out.append("each of orbit, dolly, fly-through and grazing; dB, FLIP and silhouettes against the traced full detail; px: distance in space of")
out.append("each drawn pixel from the nearest full-detail surface, by brute force). Milliseconds are medians with 95 % of bootstraps over blocks.\n")
out.append(f"Machine: {p['processor']}, {p['threads']} threads, load {p['load']:.1f}, {p['date']}; {p['device']}; {p['compiler']}, {p['flags']}.\n")
if p["load"] > p["threads"]:
    out.append("Others loaded the machine: modes were drawn in turn, so that their ratios hold and milliseconds are high.\n")
names = [s["name"] for s in d["scenes"]]
for i, s in enumerate(d["scenes"]):
    out.append(f"- {s['name']}: {s['records']:,} records, {s['bytes'] / 1e6:.1f} MB, content {s['content']}")
for t in d["truth"]:
    out.append(f"- truth of {names[t['scene']]}: with twice as many rays along each axis it changes by {number(t['doubled_db'], 1)} dB")
for note in d["not_measured"]:
    out.append(f"- not measured: {note.split(': /')[0]} (too many shapes)")
out.append("\n## Stated bounds\n")
out.append("Pixels farther from the full detail than stated and half a pixel, all scenes, cameras and errors together:\n")
out.append("| mode | pixels | beyond | share | along outlines | in closed gaps | between layers | other | most, px |\n|---|---|---|---|---|---|---|---|---|")
for mode in dict.fromkeys(r["mode"] for r in d["configurations"]):
    rows = [r["errors"] for r in d["configurations"] if r["mode"] == mode and r["errors"]["audited_pixels"]]
    total = {k: sum(r[k] for r in rows) for k in ("audited_pixels", "beyond_pixels", "beyond_outline", "beyond_gap", "beyond_between", "beyond_other")}
    if total["audited_pixels"] == 0:
        continue
    most = max((r["lod_px_max"] for r in rows), default=0)
    share = 100 * total["beyond_pixels"] / total["audited_pixels"]
    out.append(f"| {mode} | {total['audited_pixels']:.0f} | {total['beyond_pixels']:.0f} | {share:.4f} % | {total['beyond_outline']:.0f} | "
               f"{total['beyond_gap']:.0f} | {total['beyond_between']:.0f} | {total['beyond_other']:.0f} | {most:.2f} |")
for i, name in enumerate(names):
    rows = [r for r in d["configurations"] if r["scene"] == name]
    size = f"{rows[0]['width']}x{rows[0]['height']}"
    out.append(f"\n## {name}, {size}\n")
    for plot in ("error-ms", "detail-ms", "bounds", "error-bytes"):
        source = os.path.join(study, "plots", f"s{i}-{size}-{plot}.svg")
        if plot in ("detail-ms", "bounds") and not rows[0]["errors"]["audited_pixels"]:
            continue
        target = f"{os.path.splitext(name)[0]}-{plot}.svg"
        shutil.copyfile(source, os.path.join(plots, target))
        out.append(f"![{name}: {plot}](accuracy/{target})\n")
    out.append("| mode | asked, px | ms | 95 % | px p99 | px most | dB | FLIP | IoU | holes | MB of the file |\n|---|---|---|---|---|---|---|---|---|---|---|")
    for r in rows:
        e = r["errors"]
        out.append(f"| {r['mode']} | {r['error_px']:g} | {r['ms']['median']:.2f} | {r['ms']['low']:.2f} to {r['ms']['high']:.2f} | {number(e['lod_px_p99'], 3)} | "
                   f"{number(e['lod_px_max'], 2)} | {number(e['psnr_foreground_db'], 2)} | {number(e['flip_mean'], 4)} | {number(e['silhouette_iou'], 4)} | "
                   f"{number(e['holes'], 0)} | {number(e['cut_bytes'] / 1e6, 2)} |")
    out.append("\nWhat each step costs:\n\n| mode | from px | to px | ms | dB | one more dB | one pixel less |\n|---|---|---|---|---|---|---|")
    for mode, coarse, fine, took, gain, per_db, per_px in costs(rows):
        out.append(f"| {mode} | {coarse:g} | {fine:g} | {took} | {gain:+.2f} | {per_db} | {per_px} |")
open(os.path.join(results, "accuracy.md"), "w").write("\n".join(out) + "\n")
