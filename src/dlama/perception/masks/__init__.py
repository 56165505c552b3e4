"""Object masks: a picture, with or without depth, and clicks or a box in; the mask of the object out.

Begin with `prompt` (the user's input), then `rgbd` (segmentation in depth; `saliency_correction` and `outlines` correct the
masks of depth cameras). `dlama.perception.object_masks` chooses the method.
"""
