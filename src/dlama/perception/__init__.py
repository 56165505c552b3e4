"""Perception: pictures in; what is derived from them before geometry starts out. `stereo`: a rectified pair in,
disparities, their consistency and a carried-over mask out. `planes`: depth in, the planes it has and their pixels out.
`monocular`: one picture in, its estimated depth out. `object_masks`: a picture and clicks or a box in, an object's mask out.
Networks run by ONNX Runtime (`dlama.models.network_file`); no picture is read from disk here.
"""
