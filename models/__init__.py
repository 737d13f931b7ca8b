"""The stereo networks: definitions, rendered data, training and export.

The runtime never imports this package: it reads `artifacts/*.onnx` as `manifest.toml` says.
"""
