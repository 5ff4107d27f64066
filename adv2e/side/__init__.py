"""Side data of frames, carried to the clock of the events and the pixels of the sensor.

Data sets hold more than frames.  Whatever has a time, or belongs to a frame, comes out beside the
events: cut, shifted, scaled, cropped and turned as the frames were.

============================== ===================================================================
:mod:`adv2e.side.placement`    where a point of the frames lies on the sensor, and when
:mod:`adv2e.side.tables`       poses, IMU, exposures: text, a line for each time
:mod:`adv2e.side.calibration`  intrinsics of the camera
:mod:`adv2e.side.boxes`        boxes around objects
:mod:`adv2e.side.maps`         masks, depth and optical flow, a file for each frame
:mod:`adv2e.side.carrying`     finds all that, and has it written
============================== ===================================================================
"""
