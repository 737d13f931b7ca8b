"""Rendered stereo pairs with exact disparity; nothing here is a photograph of a real scene."""
