"""Object masks: a picture, with or without depth, and clicks or a box in; the mask of the object out.

Begin with `prompt` (the user's input), then `rgbd` (segmentation in depth) and `choice` (which of its masks).
`dlama.perception.object_masks` chooses the method.
"""
