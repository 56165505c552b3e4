"""Networks, tensors only: architecture and files need numpy alone, modules need torch, export needs onnx.

architecture   settings <-> names and shapes, no torch
generator      the torch modules (extra `train`)
safetensors_file, torch_file   weights on disk -> named arrays, no foreign code run
checkpoints    any file of weights -> checked weights of one network; more planes for trained weights
export/        checked weights and metadata -> an ONNX file
"""
