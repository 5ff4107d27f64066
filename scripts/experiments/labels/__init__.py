"""Networks that tell the classes of pixels from events.

=============  ====================================================================================
shapes         rendered clips of dark shapes, with labels
labelled       pictures of events with labels: rendered, measured, and of data sets
training       the steps of a training
small          one small training with its test
scores         accuracy, mIoU, and a picture
=============  ====================================================================================
"""
