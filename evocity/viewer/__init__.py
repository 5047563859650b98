"""Many births on one page: a gallery and parallel coordinates with one filter. What a run is, is
known here by nobody: births are columns of numbers, and pictures that are asked for.

- `table`: births as columns, who passes a filter; as the page reads them
- `page`: the page, plain ES modules without a build step; as one module, `joined`
- `widget`: the page as a widget of Jupyter, by anywidget of the extra ``notebook``

The page's `viewer.js` takes what it shows of a host: `render` makes one of a widget's model.
"""
