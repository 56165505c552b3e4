"""Checked weights and metadata in; an ONNX file out. Needs numpy and onnx, no torch.

onnx_graph   a graph, node by node
generator    dlama's own network
"""
