"""Characterisation: which effect a table of measured latencies or noise rates asks for."""
