"""Policies as drivers: from npz, SB3 and ONNX files, torch modules and functions."""
