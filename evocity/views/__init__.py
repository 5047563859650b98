"""What measures look at besides heights: arrays in, arrays out; `CityMap` keeps each once a map.

- `buildings`: built ground told apart into buildings, a table of them, and their outlines
- `ground`: what is not built: open space, the way to the next wall, streets and their widths
- `streets`: the graph of the open ground's middle lines, places, quarters
- `classes`: what stands here by its surface, height and shape
- `structure`: which way walls run, pixel by pixel
"""
