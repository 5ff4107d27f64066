"""Made-up lines of the study of the diagnosis."""

SETUP = {
    "width": 48, "height": 36, "seconds": 0.8, "fps": 500.0, "bits": 16, "interpolation": "linear",
}  # fmt: skip


def found(name, parameters=None, interval=None):
    return {"name": name, "parameters": parameters or {}, "interval": interval or {}}


def line_of(kind="library", effects=("refractory",), size="middle", verdict="explained", **rest):
    """Return a made-up line; by default the effects are found as they are."""
    repeat = rest.pop("repeat", 0)
    return {
        "key": f"{kind}/{'+'.join(effects)}/{size}/{repeat}", "repeat": repeat,
        "kind": kind, "effects": list(effects), "size": size, "study_seed": 0, "scene": "edges",
        "setup": SETUP, "hidden": {}, "commit": "abc", "lacking": [], "verdict": verdict,
        "found": [] if verdict in ("consistent", "unexplained") else [found(x) for x in effects],
        "alternatives": [], "truth": {}, "error": {"before": 0.9, "after": 0.5, "floor": 0.5},
        "global_p": {"before": 0.5, "after": 0.5}, "seconds": {"recording": 4.0, "diagnosis": 90.0},
        "simulations": 1000, "events": 9000, "threads": 2, "load": 1.0, "log": [], "ended": 1,
        **rest,
    }  # fmt: skip
