"""Perception: pictures in; what is derived from them before geometry starts out. So far `stereo_matching`: a rectified pair in,
disparities, their consistency and a carried-over mask out. Needs no learning and reads no files.
"""
