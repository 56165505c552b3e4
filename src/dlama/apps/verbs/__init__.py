"""Options of one verb in; what the public function of that name did, in lines, out. One file a verb, two where one needs more.

What computes (cv2, numba, torch) is imported where it is used: `--help` and wrong words are answered at once.
"""
