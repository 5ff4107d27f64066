"""The site of the documentation: pages that people write, and pages made from the program."""
