"""Policies as drivers: .npz, SB3 and ONNX files, torch modules and functions."""
