"""``adv2e protocol``: what to record with an LED, so that a diagnosis knows the camera."""

from __future__ import annotations

import click

from adv2e.cli.commands import Command

TEXT = """\
Know an event camera in ten minutes, with an LED and a still scene.

You need an LED whose current you can switch, or a lamp and a photodiode; white paper to spread the
light; and a wire from the LED's driver to the trigger input of the camera, so that you know each
switching on the clock of the events.

Prepare (4 minutes)
  Take the lens off, so that no picture is there. Light a small spot, some 30x30 pixels, or set a
  region of interest: if all pixels fire at once, the readout is late, and you measure that instead.
  Set the biases as you will use them. Let the camera warm up. Switch automatic settings off.

Record the LED (1 minute), in one recording of about 25 s
  rest    2 s each dark, medium and bright         noise that falls with light (shot_noise), leak,
          (10 times brighter each time)            leak by light (photo_leak), hot_pixels
  leaps   3 s each dark, medium and bright,        latency and bandwidth: low_pass at white and in
          by a factor of 2 to 3, up and down       the dark, source_follower, slew_limit; events a
          in turn, 50 to 150 ms apart              leap: thresholds, ON and OFF, and mismatch
  leaps   2 s by a factor of 10, 200 ms apart      dead time (refractory), reset_overshoot, readout
  ramps   up and down by a factor of 10, 3 s       thresholds without any lag; threshold_drift, if
          each way, at the beginning and end       they are others at the end; high_pass

Record a still scene (1 minute), 10 s: the lens on, grey patches, nothing moves, constant light
                                                   noise at many lights at once, hot_pixels, leak

Write stimulus.csv (4 minutes): what the light was, on the clock of the events
  time_s,light_dn      255 is white: take the brightest light for 200, and the others relative to
  0,10                 it, as your photodiode or the LED's current tells (it must be linear light)
  2.0,10
  2.0,25               two rows of one time: the light leaps
  2.1,25
  2.1,10
  5.0,10               between two rows it is a line: a slow ramp has two, a sine has many
  8.0,100
  The rows must span all events. 'light_dn 150 110 30 30' in place of light_dn is the light of the
  30x30 pixels whose first is at column 150, row 110; the others are left out. For the still scene
  give each grey patch such a column, and two rows: the beginning and the end.

Diagnose
  adv2e diagnose led.raw --light stimulus.csv -c declared.yaml --fit-thresholds -o camera/

  declared.yaml holds what you know, and nothing else. Add 'pixel: {initial_reference: random}' if
  the camera ran before. camera/model.yaml is your camera: 'adv2e convert -c camera/model.yaml'.

What this does not tell: how many lux a DN is; a delay of the trigger from one of the camera (give
--without clock_offset if you are sure of it); what the frames of the camera do; and what a whole
sensor does when all of it fires at once.
"""


@click.command("protocol", cls=Command)
def command() -> None:
    """Print what to record with an LED to know a camera.

    It takes ten minutes. Each part says which effects it determines, and how to write the table of
    light for 'adv2e diagnose --light'.

    \b
    Examples:
      adv2e protocol
      adv2e protocol > protocol.txt
    """
    click.echo(TEXT, nl=False)
