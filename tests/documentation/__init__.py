"""All that the documents show: which commands, where each is run, and whether links lead anywhere.

``python -m documentation``, in the folder of the tests, lists the commands.
"""
