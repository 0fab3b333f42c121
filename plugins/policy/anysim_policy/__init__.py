"""Learned policies as low-level controllers of anysim: ONNX and TorchScript."""
