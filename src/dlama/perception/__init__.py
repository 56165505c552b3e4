"""Perception: pictures in; depth, disparity, planes, masks and shadows out, before geometry starts.

`stereo`: a rectified pair in; disparities, their consistency and a transferred mask out. `planes`: depth in; its planes and
their pixels out. `monocular`: one picture in; its estimated depth out. `object_masks`: a picture and clicks or a box in; an
object's mask out. Networks run by ONNX Runtime (`dlama.models.network_file`); no picture is read from disk here.
"""
