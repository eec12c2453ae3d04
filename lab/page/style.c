/* SPDX-License-Identifier: MIT */
#include "lab/page/figure.h"

/* Okabe and Ito's palette, darker where thin lines need it on white and lighter on black. */
static const char light_colours[] = "--c0:#2a3038;--c1:#0067a8;--c2:#cf5400;--c3:#008a64;--c4:#b35a92;--c5:#bd8200;"
                                    "--c6:#2f93ca;--c7:#8b94a0;--grid:#e3e7ec;--minor:#f0f2f5;--frame:#7d8794;"
                                    "--paper:#fff;--text:#1c2127;--dim:#59626e;";
static const char dark_colours[] = "--c0:#d5dae0;--c1:#5fb0ec;--c2:#ff8a45;--c3:#35c79b;--c4:#e29bc6;--c5:#eeb62f;"
                                   "--c6:#93d3f8;--c7:#8792a0;--grid:#2c333c;--minor:#20262d;--frame:#788492;"
                                   "--paper:#15191e;--text:#e3e7ec;--dim:#a0aab6;";

static const char rules[] =
    ".fig{display:block;max-width:100%;height:auto;font:12px system-ui,-apple-system,\"Segoe UI\",Roboto,"
    "\"Helvetica Neue\",Arial,sans-serif;font-variant-numeric:tabular-nums}\n"
    ".fig text{fill:var(--text)}.fig .tx,.fig .ty,.fig .lx{fill:var(--dim)}\n"
    ".tx,.lx,.no,.bv{text-anchor:middle}.ty{text-anchor:end}.fig .la{font-weight:600}.ex{font-size:9px}\n"
    ".fig "
    ".no{fill:var(--dim);font-size:14px;letter-spacing:.04em}.no,.bv{paint-order:stroke;stroke:var(--paper);stroke-"
    "width:4px}\n"
    ".gr,.gm,.fr{fill:none;stroke-width:1;shape-rendering:crispEdges}\n"
    ".gr{stroke:var(--grid)}.gm{stroke:var(--minor)}.fr{stroke:var(--frame)}\n"
    ".c0{color:var(--c0)}.c1{color:var(--c1)}.c2{color:var(--c2)}.c3{color:var(--c3)}.c4{color:var(--c4)}"
    ".c5{color:var(--c5)}.c6{color:var(--c6)}.c7{color:var(--c7)}\n"
    ".ln{fill:none;stroke:currentColor;stroke-width:1.5;stroke-linejoin:round;stroke-linecap:round}\n"
    ".ln[data-d=\"1\"]{stroke-dasharray:7 4;stroke-linecap:butt}.ln[data-d=\"2\"]{stroke-dasharray:1 4;stroke-width:2}"
    ".ln[data-d=\"3\"]{stroke-dasharray:9 3 1 3}\n"
    ".lm{fill:none;stroke:currentColor;stroke-width:1.1;stroke-dasharray:10 3}"
    ".lm[data-d=\"2\"]{stroke-dasharray:2 3}.lm[data-d=\"0\"]{stroke-dasharray:none}\n"
    ".bd{fill:currentColor;fill-opacity:.17;stroke:currentColor;stroke-width:.6;stroke-opacity:.45}\n"
    ".sm{fill:none;stroke:currentColor}.sp{fill:none;stroke:currentColor;stroke-opacity:.5}\n"
    ".pt{fill:none;stroke:currentColor}.mc{stroke-linecap:round}"
    ".mf{fill:currentColor;stroke:none}\n"
    ".br rect{fill:currentColor;fill-opacity:.82;stroke:currentColor;stroke-width:1}.b1 rect{fill-opacity:.4}.b2 "
    "rect{fill-opacity:0}\n"
    ".cur{stroke:var(--dim);stroke-width:1;stroke-dasharray:2 2;pointer-events:none}\n"
    "#readout{position:fixed;display:none;pointer-events:none;background:var(--paper);color:var(--text);"
    "border:1px solid var(--frame);padding:.35em .6em;font-size:12px;line-height:1.45;white-space:pre;"
    "font-variant-numeric:tabular-nums;box-shadow:0 1px 5px rgba(0,0,0,.18)}\n"
    "@media print{.bd,.br rect{print-color-adjust:exact;-webkit-print-color-adjust:exact}"
    ".gr,.gm,.fr{shape-rendering:auto;stroke-width:.8}#readout,.cur{display:none!important}}\n";

/* Values come back from the drawn path: a vertex is found in px and mapped through the axis the frame carries. */
static const char script[] =
    "//<![CDATA[\n"
    "(function(){\n"
    "'use strict';\n"
    "var ns='http://www.w3.org/2000/svg',figs=[].slice.call(document.querySelectorAll('svg.fig[data-x]'));\n"
    "var box=document.createElement('div');box.id='readout';document.body.appendChild(box);\n"
    "function axis(e,k){var a=e.getAttribute('data-'+k).split(' ').map(Number);return a[2]?{\n"
    " at:function(t){return a[0]*Math.pow(a[1]/a[0],t);},of:function(v){return "
    "Math.log(v/a[0])/Math.log(a[1]/a[0]);}}:{\n"
    " at:function(t){return a[0]+t*(a[1]-a[0]);},of:function(v){return (v-a[0])/(a[1]-a[0]);}};}\n"
    "function num(v){return String(Number(v.toPrecision(4))).replace('-','\\u2212');}\n"
    "function vertices(p){if(p.vertices)return p.vertices;var r=[],x=0,y=0,m,\n"
    " re=/([MlmhLz])?\\s*(-?[\\d.]+)[ ]?(-?[\\d.]+)/g,c='M',d=p.getAttribute('d'),\n"
    " line=p.classList.contains('ln');\n"
    " while((m=re.exec(d))){c=m[1]||c;if(c==='M'){x=+m[2];y=+m[3];r.push([x,y]);}\n"
    "  else if(c==='l'&&line){x+=+m[2];y+=+m[3];r.push([x,y]);}}\n"
    " return p.vertices=r;}\n"
    "function nearest(p,x,y){var best=null,least=400,w=p.classList.contains('pt')?1:0;\n"
    " vertices(p).forEach(function(v){var dx=v[0]-x,dy=v[1]-y,q=dx*dx+w*.02*dy*dy;if(q<least){least=q;best=v;}});\n"
    " return best;}\n"
    "function place(f,t,label){var pls=f.querySelectorAll('svg.pl');[].forEach.call(pls,function(pl){\n"
    " var c=pl.querySelector('.cur');if(t===null||t<0||t>1){if(c)c.remove();return;}\n"
    " if(!c){c=document.createElementNS(ns,'line');c.setAttribute('class','cur');pl.appendChild(c);}\n"
    " var x=t*pl.width.baseVal.value;c.setAttribute('x1',x);c.setAttribute('x2',x);c.setAttribute('y1',0);\n"
    " c.setAttribute('y2',pl.height.baseVal.value);});}\n"
    "function show(f,pl,e){var r=pl.getBoundingClientRect();\n"
    " var k=f.viewBox.baseVal.width/f.getBoundingClientRect().width,w=pl.width.baseVal.value;\n"
    " var q=f.createSVGPoint();q.x=e.clientX;q.y=e.clientY;q=q.matrixTransform(f.getScreenCTM().inverse());\n"
    " var px=q.x-pl.x.baseVal.value,py=q.y-pl.y.baseVal.value,X=axis(f,'x'),Y=axis(pl,'y'),v=X.at(px/w);\n"
    " var link=f.getAttribute('data-link'),rows=[link+': '+num(v)];\n"
    " figs.forEach(function(g){if(g.getAttribute('data-link')===link)place(g,axis(g,'x').of(v));});\n"
    " [].forEach.call(pl.querySelectorAll('.ln,.pt,.sm'),function(p){var n=p.getAttribute('data-n');\n"
    "  var b=n?nearest(p,px,py):null;if(b)rows.push(n+': '+num(Y.at(1-b[1]/pl.height.baseVal.value))\n"
    "   +(p.classList.contains('pt')?' at '+num(X.at(b[0]/w)):''));});\n"
    " box.textContent=rows.join('\\n');box.style.display='block';\n"
    " var left=e.clientX+16;if(left+box.offsetWidth>innerWidth)left=e.clientX-16-box.offsetWidth;\n"
    " box.style.left=Math.max(0,left)+'px';box.style.top=Math.max(0,e.clientY-box.offsetHeight-10)+'px';}\n"
    "figs.forEach(function(f){\n"
    " f.addEventListener('pointermove',function(e){var hit=null;\n"
    "  [].forEach.call(f.querySelectorAll('svg.pl'),function(pl){var m=f.getScreenCTM(),b=f.createSVGPoint();\n"
    "   b.x=e.clientX;b.y=e.clientY;b=b.matrixTransform(m.inverse());\n"
    "   var x=b.x-pl.x.baseVal.value,y=b.y-pl.y.baseVal.value;\n"
    "   if(x>=0&&y>=0&&x<=pl.width.baseVal.value&&y<=pl.height.baseVal.value)hit=pl;});\n"
    "  if(hit)show(f,hit,e);else hide();});\n"
    " f.addEventListener('pointerleave',hide);});\n"
    "function hide(){box.style.display='none';figs.forEach(function(g){place(g,null);});}\n"
    "})();\n"
    "//]]>\n";

void figure_write_style(FILE *out)
{
    fprintf(out, ":root{color-scheme:light;%s}\n", light_colours);
    fprintf(out, "@media screen and (prefers-color-scheme:dark){:root{color-scheme:dark;%s}}\n", dark_colours);
    fputs(rules, out);
}

void figure_write_script(FILE *out)
{
    fputs(script, out);
}
