"""Pictures and films of events: drawing, laying out, writing.

======== =========================================================================================
styles   ``adv2e.rendering.styles``: events of a window -> picture (rows, columns, 3), uint8 RGB
layout   panels side by side, captions, contact sheets
films    files that take pictures one by one: .mp4, .webm, .avi, .gif; and .png, a sheet
preview  ``open_preview`` of ``recording``: a stream -> film or sheet, in bounded memory
======== =========================================================================================
"""
