"""Characterisation: which effect a table of measured latencies or noise rates asks for.

Imports point one way: ``table`` <- ``measurements`` <- ``latency_problem``, ``noise_problem``
(physics in ``latency``, ``noise`` and ``threshold_noise``) <- ``selection`` <- ``characterise``
<- ``report``.
"""
