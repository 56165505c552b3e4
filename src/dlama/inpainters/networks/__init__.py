"""Fillers that run a network file: a view with holes and an ONNX file in, the filled view out; ONNX Runtime, no torch.

Begin with `lama`; `contract` says what a file takes and gives, `tiling` cuts pictures for it, `engine` runs it.
"""
