"""The viewer of births: a filter, an order, a gallery, and views in tabs, each view in one file.
It knows no runs: births are columns of numbers, with pictures and parts of a document on request.

- `table`: births as columns; filters and orders; the bytes that the page reads
- `sheet`: many pictures in one image
- `page`: the page, plain ES modules without a build step; `page/views`: a file for each view
- `module_bundle`: the page as one module, with the views of other packages
- `widget`: the page as a widget of Jupyter, by anywidget of the extra ``notebook``

`viewer.js` of the page shows the data of a host; its `render` takes the model of a widget as host.
"""
