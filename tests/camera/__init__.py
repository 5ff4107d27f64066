"""An event camera by brute force, for testing what finds effects in recordings.

Light is an analytic function of time and place, evaluated at every step of 20 to 50 us; every pixel
is stepped by plain differences; frames come from a shutter of its own.  It shares no code with the
package under test, nor with ``tests/reference``: the physics is written down here a second time.

=================== ============================================================================
scene, scenes       what there is to see: textures, gratings, edges, disks, still parts
settings            keys of all effects, in the names and units of the package's configuration
light               light of the photodiodes: flicker, dark current, image lag
drive               logarithm, and what acts on it: surround, adaptation, gain of columns
photoreceptor       poles, slew limit, noise, disturbance by the readout of frames
thresholds          levels of each pixel, and how they move
injected            shot noise and hot pixels
comparator          events, dead time, reference, leak
running             leak before the recording
readout             arbiter, losses, stamps
shutter             frames: exposure, tone curve, clock
recording           files
camera              all of it together
catalogue           every effect in three sizes
=================== ============================================================================
"""

from camera.camera import Camera
from camera.scene import Flat, Scene, Still
from camera.scenes import SCENES, edges, gratings, patchwork

__all__ = ["SCENES", "Camera", "Flat", "Scene", "Still", "edges", "gratings", "patchwork"]
