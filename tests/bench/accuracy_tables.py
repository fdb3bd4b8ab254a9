"""accuracy_tables.py STUDY... RESULTS NAME: NAME.md and its plots, of folders that `stipple study SCENE...` wrote."""
import json
import os
import shutil
import sys

*studies, results, page = sys.argv[1:]
all_of = [(folder, json.load(open(os.path.join(folder, "study.json")))) for folder in studies]
plots = os.path.join(results, page)
shutil.rmtree(plots, ignore_errors=True)
os.makedirs(plots)
p = all_of[-1][1]["provenance"]
load = min(d["provenance"]["load"] for _, d in all_of)  # (others have that of the study before them)
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


def all_told(rows):
    """From 4 px of error asked for down to 1, by mode."""
    for mode in dict.fromkeys(r["mode"] for r in rows):
        at = {r["error_px"]: r for r in rows if r["mode"] == mode}
        if 4 not in at or 1 not in at:
            continue
        fine, coarse = at[1], at[4]
        gain = fine["errors"]["psnr_foreground_db"] - coarse["errors"]["psnr_foreground_db"]
        ms = fine["ms"]["median"] - coarse["ms"]["median"]
        mb = (fine["errors"]["cut_bytes"] - coarse["errors"]["cut_bytes"]) / 1e6
        apart = fine["ms"]["low"] > coarse["ms"]["high"] or fine["ms"]["high"] < coarse["ms"]["low"]
        mark = "" if apart else " *"
        per_db = "no dB to gain" if gain < 0.05 else f"{ms / gain:+.2f}{mark} ms, {mb / gain:+.2f} MB"
        yield f"{mode} | {fine['ms']['median']:.2f} | {number(fine['errors']['psnr_foreground_db'], 2)} | {fine['errors']['cut_bytes'] / 1e6:.2f} | {gain:+.2f} | {per_db} | {ms / 3:+.2f}{mark} ms, {mb / 3:+.2f} MB"


out.append("# What accuracy costs\n")
plan = all_of[-1][1]["plan"]
first = all_of[-1][1]["configurations"][0]
asked = "".join(f"{name}='{os.environ[name]}' " for name in ("PAGE", "OPTIONS", "SCENES") if os.environ.get(name))
out.append(f"Made by `STIPPLE_DATA=DATA {asked}tests/bench/accuracy_figures.sh` (it runs `stipple study SCENE --quick`, here at {first['width']} x {first['height']}, {', '.join(f'{t:g}' for t in plan['targets_px'])} px asked for, {plan['blocks']} blocks of {plan['frames']} frames; one camera of")
out.append("each of orbit, dolly, fly-through and grazing; dB, FLIP and silhouettes against the traced full detail; px: distance in space of")
out.append("each drawn pixel from the nearest full-detail surface, by brute force). Milliseconds are medians with 95 % of bootstraps over blocks.")
out.append("Pop: greatest change of a channel, of 255, at p99.9 where the cut is that of a camera 9 % farther away and the camera is not; most: of any pixel; faded: as pop, of means of 16 frames over which levels fade, at 160 x 90. Flicker: by how")
out.append("much more a turn of a quarter of a pixel changes pixels than it changes the truth, of 255, mean.\n")
out.append(f"Machine: {p['processor']}, {p['threads']} cores; load {load:.1f}; {p['date']}; {p['device']}; {p['compiler']}, {p['flags']}.\n")
if load > 2:
    out.append("**Others shared the machine** while this was measured. That touches times and nothing else: the columns ms and 95 %, the milliseconds of what a")
    out.append("step costs, and the seconds after starts and jumps. Frames of all modes and errors were drawn in turn, in blocks of another order each, so that ratios between")
    out.append("times hold where they are apart; as they stand, milliseconds are too high. Errors, records and bytes are the same on any machine, busy or not.\n")
for folder, d in all_of:
    names = [s["name"] for s in d["scenes"]]
    for i, s in enumerate(d["scenes"]):
        out.append(f"- {s['name']}: {s['records']:,} records, {s['bytes'] / 1e6:.1f} MB, content {s['content']}")
    for t in d["truth"]:
        out.append(f"- truth of {names[t['scene']]}: with twice as many rays along each axis it changes by {number(t['doubled_db'], 1)} dB")
    for note in d["not_measured"]:
        short = note.split(": /")[0].split(" (name the files")[0]
        out.append(f"- not measured: {short}" + (" (too many shapes)" if "full detail" in short else ""))
    for k in d["originals"]:
        line = (f"- points of {k['scene']} against its file: {k['places_beyond']} of {k['points']:,} farther than their leaves round by "
                f"({k['rounding']:.2g} at most, {k['rounding_stated']:.2g} stated)")
        if k["normals"]:
            line += f"; {k['normals_beyond']} of {k['normals']:,} normals more than {k['normal_deg_stated']} degrees off"
        if k["colours"]:
            line += f"; {k['colours_beyond']} of {k['colours']:,} colours unlike"
        out.append(line)
out.append("\n## All told\n")
out.append("At one pixel asked for, and what it costs more than four do: by dB gained, and by pixel of error. (*: the two times cannot be told apart.) Each step by itself stands with its scene.\n")
out.append("| scene | mode | ms at 1 px | dB at 1 px | MB at 1 px | dB more than at 4 px | one more dB | one pixel less |\n|---|---|---|---|---|---|---|---|")
for folder, d in all_of:
    for name in [s["name"] for s in d["scenes"]]:
        for line in all_told([r for r in d["configurations"] if r["scene"] == name]):
            out.append(f"| {name} | {line} |")
out.append("\n## Stated bounds\n")
out.append("Pixels farther from the full detail than stated and half a pixel, all scenes, cameras and errors together:\n")
out.append("| mode | pixels | beyond | share | along outlines | in closed gaps | between layers | other | most, px |\n|---|---|---|---|---|---|---|---|---|")
every = [r for _, d in all_of for r in d["configurations"]]
for mode in dict.fromkeys(r["mode"] for r in every):
    rows = [r["errors"] for r in every if r["mode"] == mode and r["errors"]["audited_pixels"]]
    total = {k: sum(r[k] for r in rows) for k in ("audited_pixels", "beyond_pixels", "beyond_outline", "beyond_gap", "beyond_between", "beyond_other")}
    if total["audited_pixels"] == 0:
        continue
    most = max((r["lod_px_max"] for r in rows), default=0)
    share = 100 * total["beyond_pixels"] / total["audited_pixels"]
    out.append(f"| {mode} | {total['audited_pixels']:.0f} | {total['beyond_pixels']:.0f} | {share:.4f} % | {total['beyond_outline']:.0f} | "
               f"{total['beyond_gap']:.0f} | {total['beyond_between']:.0f} | {total['beyond_other']:.0f} | {most:.2f} |")
def scene(study, d, i, name):
    rows = [r for r in d["configurations"] if r["scene"] == name]
    size = f"{rows[0]['width']}x{rows[0]['height']}"
    out.append(f"\n## {name}, {size}\n")
    for plot in ("error-ms", "detail-ms", "bounds", "error-bytes", "budgets", "arrival-seconds", "arrival-bytes"):
        source = os.path.join(study, "plots", f"s{i}-{size}-{plot}.svg")
        if not os.path.exists(source) or plot in ("detail-ms", "bounds") and not rows[0]["errors"]["audited_pixels"]:
            continue
        target = f"{os.path.splitext(name)[0]}-{plot}.svg"
        shutil.copyfile(source, os.path.join(plots, target))
        out.append(f"![{name}: {plot}]({page}/{target})\n")
    out.append("| mode | asked, px | ms | 95 % | px p99 | px most | dB | FLIP | IoU | holes | pop | most | faded | flicker | MB of the file |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|")
    for r in rows:
        e = r["errors"]
        out.append(f"| {r['mode']} | {r['error_px']:g} | {r['ms']['median']:.2f} | {r['ms']['low']:.2f} to {r['ms']['high']:.2f} | {number(e['lod_px_p99'], 3)} | "
                   f"{number(e['lod_px_max'], 2)} | {number(e['psnr_foreground_db'], 2)} | {number(e['flip_mean'], 4)} | {number(e['silhouette_iou'], 4)} | "
                   f"{number(e['holes'], 0)} | {number(e['pop_p999'], 0)} | {number(e['pop_max'], 0)} | {number(e['pop_faded_p999'], 0)} | {number(e['flicker_mean'], 2)} | {number(e['cut_bytes'] / 1e6, 2)} |")
    out.append("\nWhat each step costs:\n\n| mode | from px | to px | ms | dB | one more dB | one pixel less |\n|---|---|---|---|---|---|---|")
    for mode, coarse, fine, took, gain, per_db, per_px in costs(rows):
        out.append(f"| {mode} | {coarse:g} | {fine:g} | {took} | {gain:+.2f} | {per_db} | {per_px} |")
    budgets = [r for r in d["budgets"] if r["scene"] == name]
    if budgets:
        out.append("\nWithin budgets of records (the error asked for is the smallest):\n")
        out.append("| at most | drawn | stated, px | px p99 | ms | dB | MB of the file |\n|---|---|---|---|---|---|---|")
    for r in budgets:
        e = r["errors"]
        out.append(f"| {r['records_at_most']:,} | {e['records'] + e['triangles']:,.0f} | {number(e['stated_px'], 2)} | {number(e['lod_px_p99'], 3)} | "
                   f"{r['ms']['median']:.2f} | {number(e['psnr_foreground_db'], 2)} | {number(e['cut_bytes'] / 1e6, 2)} |")
    arrivals = [a for a in d["arrivals"] if a["scene"] == name]
    if arrivals:
        out.append("\nFrom a cold start and after jumps of the camera, frame after frame, files in the system's cache (MB: of the file):\n")
        out.append("| event | s to a picture | s to 30 dB | MB to 30 dB | s to all | MB |\n|---|---|---|---|---|---|")
    for a in arrivals:
        out.append(f"| {a['event']} | {number(a['first_seconds'], 3)} | {number(a['seconds_to_30_db'], 3)} | "
                   f"{number(a['bytes_to_30_db'] / 1e6 if a['bytes_to_30_db'] is not None else None, 1)} | "
                   f"{number(a['seconds'], 3) if a['is_complete'] else '-'} | {a['bytes'] / 1e6:.1f} |")


for folder, d in all_of:
    for i, s in enumerate(d["scenes"]):
        scene(folder, d, i, s["name"])
open(os.path.join(results, page + ".md"), "w").write("\n".join(out) + "\n")
