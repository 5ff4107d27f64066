"""Training sets of a batch: an export for each sequence, beside its events."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from adv2e.files.staging import Staging, writing
from adv2e.files.states import digest_of

_VALID_SHARE = 0.2
_LISTS = ("e2vid-train.txt", "e2vid-valid.txt")


@dataclass(frozen=True)
class Export:
    """Export of the events of each sequence, as by ``adv2e export``: kind and settings.

    Attributes
    ----------
    kind : str
        One of :data:`adv2e.options.EXPORTS`.
    window_us : int, optional
        Length of the windows [us]; default: for voxel grids, from each image to the next, for
        Ev-SegNet, 50 ms before each.
    bins : int
        Of a voxel grid.
    """

    kind: str
    window_us: int | None = None
    bins: int = 5

    @property
    def needs_frames(self) -> bool:
        """True if files of events must hold the frames."""
        return self.kind != "voxel" or self.window_us is None

    def described(self) -> dict[str, Any]:
        """Return the settings as the manifest records them."""
        return asdict(self)

    def make(
        self, events: Path, folder: Path, threads: int, doubt: Callable[[str], None]
    ) -> dict[str, Any]:
        """Write the export of one file; return its entry in the manifest.

        Raises
        ------
        Adv2eError
            Something is wrong with the file; then nothing is left.
        """
        from adv2e.exporting import export  # noqa: PLC0415 - in the process that converts
        from adv2e.exporting.voxels import VoxelSettings  # noqa: PLC0415

        how: dict[str, Any] = {"overwrite": True, "doubt": doubt}
        if self.kind == "e2vid":  # which ones are for validation, the lists of the batch say
            done = export.export_e2vid([events], folder, 0.0, threads, **how)
        elif self.kind == "voxel":
            cutting = export.Cutting(self.window_us, at_images=self.window_us is None)
            done = export.export_voxels(
                [events], folder, cutting, VoxelSettings(bins=self.bins), **how
            )
        else:
            done = export.export_ev_segnet([events], folder, self.window_us or 50_000, **how)
        return {**self.described(), "items": done.items, "sha256": digest_of(folder)}


def write_lists(dest: Path, records: Iterable[Mapping[str, Any]]) -> None:
    """Write the lists of exported sequences for training and for validation.

    The order comes from their seeds, so that sequences that are added later hardly change it.
    """
    files = [
        (record["seed"], dest.resolve() / f"{record['name']}.e2vid" / "sequences")
        for record in records
        if record.get("export", {}).get("kind") == "e2vid"
    ]
    files.sort(key=lambda one: (one[0], str(one[1])))
    held = math.ceil(_VALID_SHARE * len(files))
    with Staging(overwrite=True) as staging, writing(dest):
        places = [staging.file(dest / name) for name in _LISTS]
        staging.prepare()
        for place, chosen in zip(places, (files[held:], files[:held]), strict=True):
            lines = sorted(str(one) for _, folder in chosen for one in folder.glob("*.h5"))
            place.write_text("".join(f"{line}\n" for line in lines), "utf-8", newline="\n")
