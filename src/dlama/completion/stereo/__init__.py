"""A rectified pair in; both views completed so that they agree out.

stereo        the verb, and the order of the steps
disparities   the disparity of both pictures, found or given
pair          the pair as matched and as completed
exchange      what the other camera measured, in each view
published     the pictures filled one by one, as the paper does
"""
