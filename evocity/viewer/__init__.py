"""The viewer of births: a gallery, parallel coordinates, a scatter plot and a grid with one filter.
It knows no runs: births are columns of numbers, with pictures on request.

- `table`: births as columns; filters and orders; the bytes that the page reads
- `sheet`: many pictures in one image
- `page`: the page, plain ES modules without a build step; `module_bundle`: the page as one module
- `widget`: the page as a widget of Jupyter, by anywidget of the extra ``notebook``

`viewer.js` of the page shows the data of a host; its `render` takes the model of a widget as host.
"""
