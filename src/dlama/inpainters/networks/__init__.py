"""Fillers that run a network file: a view with holes and an ONNX file in; the filled view out. ONNX Runtime, no torch.

Begin with `lama`; `contract` describes a file's inputs and outputs, `tiling` crops pictures for it, `engine` runs it.
"""
